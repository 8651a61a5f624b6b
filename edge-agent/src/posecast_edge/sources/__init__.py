"""Where samples come from: each kind of source has `open_source` in a module of its own."""
