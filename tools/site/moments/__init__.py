"""The guide's gallery: recorded moments of simulated robots, and the player that shows them."""
