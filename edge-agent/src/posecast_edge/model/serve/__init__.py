"""A bundle as it is kept, cached and served to those who ask."""
