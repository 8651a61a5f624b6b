"""A hall with more viewers than its relay accepts. The others use the lane. The relay is replaced once."""
