"""Names each bad part of the input once, and counts the rest: what stays bad must not flood the log."""

from __future__ import annotations

import re
from collections.abc import Callable

NAMED_MAX = 100  # parts
PART_MAX = 200  # characters of a part that are compared
FIRST_COUNT = 10  # of problems that were not named; then 100, 1000, …
_NUMBER = re.compile(r"\d+")


class PartLog:
    """`say` is called with each line; `noun`: what is counted. Not thread-safe."""

    def __init__(self, say: Callable[[str], None], noun: str) -> None:
        self._say = say
        self._noun = noun
        self._named: set[str] = set()
        self._held = 0
        self._said = 0  # of those
        self._newest = ""

    def add(self, part: str, text: str) -> None:
        """Log `text` if this part was not named before; otherwise count it. `part`: what is bad and how, the
        same each time."""
        part = part[:PART_MAX]
        if part not in self._named and len(self._named) < NAMED_MAX:
            self._named.add(part)
            more = f"; further {self._noun} are only counted" if len(self._named) == NAMED_MAX else ""
            self._say(f"{text}{more}")
            return
        self._held += 1
        self._newest = text
        if self._held >= max(FIRST_COUNT, 10 * self._said):
            self.flush()

    def flush(self) -> None:
        """Log how many have been counted, at the end."""
        if self._held > self._said:
            self._said = self._held
            self._say(f"{self._held} more {self._noun}, the newest: {self._newest}")


def kind_of(text: str) -> str:
    """The part of a problem that has no name: its text without numbers, which differ each time."""
    return _NUMBER.sub("#", text)
