"""Expands xacro, the macros in which ROS robots are written, in a process of its own."""
