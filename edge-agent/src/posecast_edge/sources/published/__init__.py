"""The source for Python programs: `posecast.Robot` writes to it, the agent reads it."""
