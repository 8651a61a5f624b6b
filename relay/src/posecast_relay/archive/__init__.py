"""The past in an object store: what is kept for days, months and years."""
