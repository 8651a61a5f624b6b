"""`posecast-relay past`: lists, exports and deletes recordings of the past."""
