"""Documents over HTTP: robots, their state and models, the page, health and metrics."""
