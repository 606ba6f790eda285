"""Where operator frames come from, and in which order they count; decides nothing about the robot."""
