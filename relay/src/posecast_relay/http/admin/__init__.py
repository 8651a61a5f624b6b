"""The page `/admin` for the relay's operator, and its routes."""
