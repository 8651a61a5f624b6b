"""Deletion from an object store: tombstones, what they cover, and data that no segment names any more."""
