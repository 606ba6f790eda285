"""How far a robot's shapes are apart, in compiled plain loops; knows angles and shapes, no limits and no targets."""
