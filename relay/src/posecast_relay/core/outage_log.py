"""Decides what the log says of a server that comes and goes: each reason once, and once that it is over."""

from __future__ import annotations

CALM_S = 10.0  # without a failure, and a trouble is over; what fails before belongs to the same one


class OutageLog:
    """The troubles of one way to a server. On a busy machine it is late a few times in a row: one trouble.
    `now` is in seconds of a clock that never goes back.
    """

    def __init__(self) -> None:
        self._told: set[str] = set()  # kinds of failure in this trouble
        self._failed_at = float("-inf")

    @property
    def is_open(self) -> bool:
        """Whether there is a trouble that is not over yet."""
        return bool(self._told)

    def note_failure(self, error: BaseException, now: float) -> str | None:
        """Note that the server failed. Return why; None when this trouble has had such a failure already."""
        self._failed_at = now
        kind = type(error).__name__
        if kind in self._told:
            return None
        self._told.add(kind)
        return str(error) or kind

    def note_success(self, now: float) -> bool:
        """Note that the server works. True when that ends a trouble: once, after CALM_S without a failure."""
        if not self._told or now - self._failed_at < CALM_S:
            return False
        self._told.clear()
        return True
