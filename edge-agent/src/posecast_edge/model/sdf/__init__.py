"""Reads SDF, the format of Gazebo, into the types of a URDF."""
