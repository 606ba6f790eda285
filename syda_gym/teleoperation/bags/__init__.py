"""Live runs as MCAP, which Foxglove, Rerun and ROS open: written beside or from a journal, never read by the loop."""
