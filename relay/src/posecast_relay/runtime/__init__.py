"""Runs the core on an event loop: carries out its actions, keeps its timers, writes to sockets."""
