"""Before the first run: adding a robot, recording paired motions."""
