"""What `syda-gym demo` does: fit, choose a route, play, refine, and write the report."""
