"""The past over HTTP: its routes, and what they answer."""
