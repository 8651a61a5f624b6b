"""The error of a `posecast-relay past` command: one line, and exit status 1."""

from __future__ import annotations


class CommandFailed(Exception):
    """A command failed, or the user answered no. The message is one line with the reason."""
