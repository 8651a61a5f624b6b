"""Reads a MuJoCo model (MJCF): compiled by MuJoCo in a separate process, then read as links and joints."""
