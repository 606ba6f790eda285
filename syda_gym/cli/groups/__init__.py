"""Options that belong together, as one value: a group and how a command takes it; no command, and no single option."""
