"""Deletion from an object store: tombstones, what they cover, and what nothing names any more."""
