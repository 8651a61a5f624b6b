"""A bundle as it is stored, cached and served."""
