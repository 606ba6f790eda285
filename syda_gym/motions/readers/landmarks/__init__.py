"""Recordings that are trees or arrays of points: JSON of many trackers, ``.npy`` and ``.npz``."""
