"""What all programs of Posecast share on the command line: how they parse it, and how they print."""
