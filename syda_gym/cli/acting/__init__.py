"""Commands that deal with agents and with what runs leave behind."""
