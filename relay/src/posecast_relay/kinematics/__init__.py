"""Computes the poses of a model's links."""
