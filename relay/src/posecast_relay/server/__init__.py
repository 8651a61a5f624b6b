"""One relay process: its role, its listener, from its first socket to its last."""
