"""Finding the arms of a robot that nobody has described; knows trees and robots, nothing of motions or physics."""
