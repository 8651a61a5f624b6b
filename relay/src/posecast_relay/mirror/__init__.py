"""Copies the public views to other databases."""
