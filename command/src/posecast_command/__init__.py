"""The `posecast` command: every tool that puts a robot on a URL, under one name."""
