"""Computes a robot's centre of mass and support in one pose. Plain arithmetic, the same as in the page."""
