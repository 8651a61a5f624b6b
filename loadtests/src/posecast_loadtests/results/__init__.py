"""The checks of each viewer, the counts over all processes, and the verdict on the counts."""
