"""Files of this library and of the paper, which say themselves whose joints they hold."""
