"""The commands that train, tune, compare, film and export agents, and the options that they share; no other command."""
