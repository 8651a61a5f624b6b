"""The robot's model, as the agent serves it: a manifest and files."""
