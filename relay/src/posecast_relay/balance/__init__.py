"""Where a robot's mass is and what it stands on, in one pose: plain arithmetic, as the page has it."""
