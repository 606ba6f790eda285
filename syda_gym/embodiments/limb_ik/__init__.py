"""The limb solver: joint angles that point a robot's limbs in wanted directions; knows robots, no people."""
