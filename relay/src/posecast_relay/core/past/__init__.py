"""The past: what robots sent in the last while, in segments (`wire/SPEC.md` §10), and where they are kept."""
