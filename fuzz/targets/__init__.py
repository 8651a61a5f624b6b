"""Readers of strangers' bytes, by who reads them."""
