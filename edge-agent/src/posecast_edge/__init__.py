"""The agent beside the robot: reads, encodes, pushes."""
