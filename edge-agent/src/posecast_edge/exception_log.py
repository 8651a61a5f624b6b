"""Counts and logs exceptions that must not reach other parts of the agent."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import TypeVar

from posecast_edge.rate_limited_log import RateLimitedLog
from posecast_edge.visible import make_visible

log = logging.getLogger("posecast_edge")

SAY_EVERY_S = 10.0
T = TypeVar("T")


class ExceptionLog:
    """Counts exceptions by the place that raised them. May be used from any thread."""

    def __init__(self, say: Callable[[str], None] = log.warning) -> None:
        self._say = say
        self._by_place: dict[str, RateLimitedLog] = {}

    def add(self, place: str, error: BaseException) -> None:
        """Count and log an exception. `place` is one of a few fixed words that say where it was raised."""
        log.debug("%s", place, exc_info=error)
        text = f"{place}: {type(error).__name__}: {make_visible(str(error), 200)}"
        self.get_log(place).add(text, time.monotonic())

    def count(self, place: str) -> int:
        """How many exceptions this place has raised so far."""
        return self.get_log(place).total

    def get_log(self, place: str) -> RateLimitedLog:
        """The rate-limited log for the exceptions of one place."""
        return self._by_place.setdefault(
            place, RateLimitedLog(self._say, f"exceptions in {place}", SAY_EVERY_S)
        )

    def guard(self, place: str, call: Callable[[T], None]) -> Callable[[T], None]:
        """Wrap `call` as a library's callback: an exception is logged under `place` and never reaches the
        library."""

        def guarded_call(argument: T) -> None:
            try:
                call(argument)
            except Exception as e:
                self.add(place, e)

        return guarded_call
