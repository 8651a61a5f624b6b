"""Reports once why background work in a store fails, also while no robot is on air."""

from __future__ import annotations

import logging
from collections.abc import Callable

log = logging.getLogger("posecast_relay")


class BackgroundTrouble:
    """Why parts of the background work fail just now. `is_told`: whether the log already says that the store
    is away.
    """

    def __init__(self, is_told: Callable[[], bool] = lambda: False) -> None:
        self._is_told = is_told
        self._why: dict[str, str] = {}  # by part

    def note_failure(self, part: str, why: str) -> None:
        """Note that a part could not be done, and say so when all was well before."""
        if not self._why and not self._is_told():
            log.warning("the archive: %s; retried until it works", why)
        self._why[part] = why

    def note_success(self, part: str) -> None:
        """Note that a part was done, and say so when nothing is wrong any more."""
        if self._why.pop(part, None) is not None and not self._why:
            log.warning("the archive: the store works again")

    def find_trouble(self) -> str | None:
        """Return why something can't be done; None when all is well. From any thread."""
        return next(iter(list(self._why.values())), None)
