"""Computes a robot's center of mass and support in one pose. Plain arithmetic, the same as in the page."""
