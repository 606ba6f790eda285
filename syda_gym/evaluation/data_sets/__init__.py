"""Episodes of ``SydaTeleop-v0`` in the formats that others learn from; nothing here judges them."""
