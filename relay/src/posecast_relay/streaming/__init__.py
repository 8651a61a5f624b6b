"""Streams to viewers: WebSocket and server-sent events, and the connections that they come by."""
