"""Logs once why background work on a store fails, even while no robot is online."""

from __future__ import annotations

import logging
from collections.abc import Callable

log = logging.getLogger("posecast_relay")


class BackgroundTrouble:
    """Why parts of the background work currently fail. `is_told`: whether the log already reports the store
    as away.
    """

    def __init__(self, is_told: Callable[[], bool] = lambda: False) -> None:
        self._is_told = is_told
        self._why: dict[str, str] = {}  # by part

    def note_failure(self, part: str, why: str) -> None:
        """Note that a part failed. Logs it if all was well before."""
        if not self._why and not self._is_told():
            log.warning("the archive: %s; retrying until it works", why)
        self._why[part] = why

    def note_success(self, part: str) -> None:
        """Note that a part succeeded. Logs it if that was the last failing part."""
        if self._why.pop(part, None) is not None and not self._why:
            log.warning("the archive: the store works again")

    def find_trouble(self) -> str | None:
        """Return why a part fails; None if all is well. Callable from any thread."""
        return next(iter(list(self._why.values())), None)
