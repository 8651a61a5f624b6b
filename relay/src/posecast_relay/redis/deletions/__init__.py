"""Deletions of the past in Redis: told to every process, and carried out."""
