"""What every command has to pass: limits, self-collision, watchdog, the way home."""
