"""What is wrong with a robot's description, in plain words."""
