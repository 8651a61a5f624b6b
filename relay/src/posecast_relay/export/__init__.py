"""The past as files that other programs read: CSV, and MCAP with the messages of ROS 2."""
