"""Exact distances between the links of one robot, and velocities that keep them apart."""
