"""Expands xacro, ROS's macro language for robots, in a separate process."""
