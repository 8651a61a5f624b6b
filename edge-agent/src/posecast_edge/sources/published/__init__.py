"""What a Python program publishes by itself: `posecast.Robot` feeds it, the agent reads it."""
