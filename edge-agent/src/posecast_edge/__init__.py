"""The agent: reads a robot's state, encodes it and sends it to a relay."""
