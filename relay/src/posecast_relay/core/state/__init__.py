"""The state of each robot: streams, runs, liveness, its share of the relay, and its viewers' rooms."""
