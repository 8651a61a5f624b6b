"""Logs problems with the input without flooding the log: the first at once, then a count once a second."""

from __future__ import annotations

from collections.abc import Callable


class RateLimitedLog:
    """Rate limit for one kind of message. Times are arguments, in monotonic seconds."""

    def __init__(self, say: Callable[[str], None], noun: str, every_s: float = 1.0) -> None:
        self._say = say
        self._noun = noun
        self._every_s = every_s
        self._said_s: float | None = None
        self._held = 0
        self._newest = ""
        self.total = 0

    def add(self, text: str, now_s: float) -> None:
        """Log `text` now when nothing was logged in the last second; otherwise only count it."""
        self.total += 1
        if self._said_s is None or (self._held == 0 and now_s - self._said_s >= self._every_s):
            self._said_s = now_s
            self._say(text)
            return
        self._held += 1
        self._newest = text
        self.tick(now_s)

    def tick(self, now_s: float) -> None:
        """Log the count of messages held back when a second has passed since the last line."""
        if self._held and self._said_s is not None and now_s - self._said_s >= self._every_s:
            self.flush(now_s)

    def flush(self, now_s: float) -> None:
        """Log the count of messages held back now, if there are any."""
        if self._held:
            self._say(f"{self._held} more {self._noun}, the newest: {self._newest}")
            self._held = 0
            self._said_s = now_s
