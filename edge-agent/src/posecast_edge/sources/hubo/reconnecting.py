"""Common part of both channel readers: retries for ever, and logs failures at a limited rate."""

from __future__ import annotations

import logging
import threading
import time
from abc import ABC, abstractmethod

from posecast_edge.kit import SAY_EVERY_S, Backoff, RateLimitedLog

log = logging.getLogger("posecast_edge.ach")

WAIT_S = 0.2  # the longest time in one call
FRAME_MAX = 1 << 16  # bytes; a hubo-ach channel is made for 3,000. A longer one ends the connection
KEPT_MAX = 64  # frames read at once; if there are more, only the newest ones are checked for faults


class ReaderError(Exception):
    """The open file or connection can't be used any more. One line."""


class PersistentReader(ABC):
    """Base class of the channel readers. One thread calls `wait_for_frames` repeatedly."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._opened = False
        self._backoff = Backoff()
        self._in_trouble = False
        self._trouble = RateLimitedLog(log.warning, f"failures of {name}", SAY_EVERY_S)

    def wait_for_frames(self, stop: threading.Event, wanted_s: float) -> list[bytes]:
        """Frames that arrived since the last call, oldest first, at most KEPT_MAX; [] when none arrives
        within WAIT_S. It may wait for the first frame at or after `wanted_s` (monotonic seconds) if that is
        soon.

        Errors are logged (the first at once, then counts) and the channel is opened again.
        """
        try:
            if not self._opened:
                if not self._backoff.is_due(time.monotonic()):
                    stop.wait(WAIT_S / 4)
                    return []
                self._open()
                self._opened = True
                self._backoff.record_success(time.monotonic())
            frames = self._next(stop, wanted_s)
        except (OSError, ReaderError) as e:
            self.close()
            now_s = time.monotonic()
            self._backoff.record_failure(now_s)
            self._in_trouble = True
            self._trouble.add(f"{self.name}: {self._reason(e)}; still trying", now_s)
            return []
        if frames and self._in_trouble:
            self._in_trouble = False
            log.info("%s: receiving frames again", self.name)
        return frames

    def close(self) -> None:
        """Close the file or connection."""
        self._opened = False

    @abstractmethod
    def _open(self) -> None:
        """Raises OSError or ReaderError when it can't be opened; `close` is called in that case, too."""

    @abstractmethod
    def _next(self, stop: threading.Event, wanted_s: float) -> list[bytes]:
        """Like `wait_for_frames`. After OSError or ReaderError, the caller closes and tries again later."""

    def _reason(self, e: Exception) -> str:
        return str((e.strerror if isinstance(e, OSError) else None) or e)
