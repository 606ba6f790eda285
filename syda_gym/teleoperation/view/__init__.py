"""The cockpit: a live page with the operator, the robot, plots and buttons; it asks the loop and never holds it up."""
