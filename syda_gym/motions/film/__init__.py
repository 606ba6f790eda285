"""People in pictures: films and cameras, the pose model that finds a person in them, and films as motions."""
