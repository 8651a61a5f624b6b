"""How a command of `posecast-relay past` fails: by one line and exit status 1."""

from __future__ import annotations


class CommandFailed(Exception):
    """A command could not do what it was asked to, or was told not to. The message is the one line that says
    why."""
