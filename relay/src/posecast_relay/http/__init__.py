"""The HTTP API: robots, their state and models, the page, health and metrics."""
