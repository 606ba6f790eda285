"""Recordings that a library of their own opens: C3D of motion capture, bags of ROS 1 and 2, MCAP."""
