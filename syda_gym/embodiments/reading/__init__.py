"""From a file to a tree of links and joints that every parser takes: URDF, xacro, MJCF; knows no arms and no bodies."""
