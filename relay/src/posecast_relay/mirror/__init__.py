"""Copies of the public views in other databases."""
