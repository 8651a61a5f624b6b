"""A source, a description format and a store as somebody else would add them: one file and one row each."""
