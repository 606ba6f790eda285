"""Functions from codes to codes, and how their numbers are found; knows arrays, no bodies."""
