"""Builds the demo robot: its shells, its URDF, and a minute of its life. Needs numpy; none of it ships."""
