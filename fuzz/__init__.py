"""Strangers' bytes for every reader on a boundary, led by coverage: `make fuzz`."""
