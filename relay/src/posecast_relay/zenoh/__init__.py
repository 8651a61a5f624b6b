"""Runs the Zenoh router that edges connect to, and takes in what they send through it."""
