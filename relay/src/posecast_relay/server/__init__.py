"""Runs one relay process: opens its listener and what its role needs, serves, and closes it all."""
