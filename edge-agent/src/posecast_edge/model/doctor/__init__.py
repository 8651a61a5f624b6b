"""Finds problems in a robot's description."""
