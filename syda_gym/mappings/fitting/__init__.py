"""One door to all methods, what they share, and the held-out errors of a fit."""
