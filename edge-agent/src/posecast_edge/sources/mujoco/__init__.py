"""A simulated robot (MuJoCo)."""
