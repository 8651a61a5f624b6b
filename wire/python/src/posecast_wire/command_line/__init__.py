"""Shared by the command lines of all Posecast programs: parsing and output."""
