"""The page for whoever runs the relay, and its routes."""
