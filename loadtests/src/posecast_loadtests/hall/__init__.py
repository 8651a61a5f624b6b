"""A hall with more viewers than its relay takes: the others go on in the lane. The relay is replaced once."""
