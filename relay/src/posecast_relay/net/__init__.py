"""Streams to viewers, over WebSocket and server-sent events, and their HTTP connections."""
