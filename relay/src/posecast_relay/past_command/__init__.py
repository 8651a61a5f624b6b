"""`posecast-relay past`: what is kept of the past, and its deletion."""
