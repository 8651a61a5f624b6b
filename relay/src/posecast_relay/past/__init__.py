"""The past: data from robots in segments (`wire/SPEC.md` §10), from the recorder to the HTTP routes."""
