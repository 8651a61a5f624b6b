"""What the relay decides: who gets what, what may be dropped, who goes. No socket, clock or randomness."""
