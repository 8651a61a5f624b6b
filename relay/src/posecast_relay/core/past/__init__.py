"""The past: recent data from robots, in segments (`wire/SPEC.md` §10), and where it is kept."""
