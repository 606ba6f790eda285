"""Data sets for others: episodes of ``SydaTeleop-v0`` in the formats that offline learning reads; nothing here judges them."""
