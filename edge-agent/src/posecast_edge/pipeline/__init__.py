"""Turns samples into frames and events: checks, flattens, samples, paces and encodes. Does no I/O."""
