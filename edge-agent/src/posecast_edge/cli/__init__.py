"""The commands: `run`, `probe`, `doctor`, `model build`, `profile new`; their flags and what they print."""
