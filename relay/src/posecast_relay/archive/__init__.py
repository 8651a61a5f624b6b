"""The past in an object store, kept for days, months or years."""
