"""The command `posecast`: everything that puts a robot on a URL, under one name."""
