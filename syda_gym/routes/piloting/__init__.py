"""From two bodies to the mapping that drives: what was recorded, else unfitted, by the route if there are several."""
