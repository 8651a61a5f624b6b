"""A stretch of the past as files that any static host serves (SPEC §12): where it comes from, how it lies."""
