"""Zenoh: the router that edges connect to, and what they send through it."""
