"""A MuJoCo model (MJCF) as a body: compiled by MuJoCo in a process of its own, read as links and joints."""
