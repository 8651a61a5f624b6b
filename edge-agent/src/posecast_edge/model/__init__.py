"""The robot's model, which the agent serves as a manifest and files."""
