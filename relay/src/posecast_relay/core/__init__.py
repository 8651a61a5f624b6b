"""The relay's decisions: who gets what, what is dropped, who is disconnected. No sockets, clocks or
randomness."""
