"""The embedded motions: actions, bodies that perform them, and the seed they come from; reads no recording."""
