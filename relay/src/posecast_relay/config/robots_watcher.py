"""Watches the robots file and its expiring credentials while the relay runs."""

from __future__ import annotations

import asyncio
import logging
import os
import time
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path

from posecast_relay.config.robots_file import UnreadableError, read_robots
from posecast_relay.config.robots_reader import Robots, RobotsError

log = logging.getLogger("posecast_relay")

LOOK_S = 0.5
PAUSE_MAX = 16  # checks between two attempts to apply a change

FileState = tuple[int, int, int, int]


class RobotsWatcher:
    """Calls `changed` with the robots when they change, a credential expires, or one of the files `beside`
    (certificates) is replaced.

    If the file is invalid, unreadable, missing or empty (an editor has just begun to write it, or the disk
    is full), the last good version stays in force. The log has one line for each such change of the file, and
    one when the file is good again.

    If `changed` raises, it is called again, after pauses of up to PAUSE_MAX checks.
    """

    def __init__(
        self,
        path: Path,
        robots: Robots,
        changed: Callable[[Robots], Awaitable[None]],
        read: Callable[[Path], Robots] = read_robots,
        beside: Sequence[Path] = (),
    ) -> None:
        self.robots = robots
        self.refused = 0  # how often the file was invalid
        self.trouble: str | None = None  # the file's present error
        self.failure: str | None = None  # why the last change is not in force yet
        self._path = path
        self._changed = changed
        self._read = read
        self._seen: FileState | None = (0, 0, 0, 0)  # it may have changed since it was read: look again
        self._must_retry = False
        self._is_due = False  # a change is not in force yet
        self._pause = self._pauses = 0  # checks left until the next attempt; how long the last pause was
        self._beside = beside
        self._beside_taken = self._beside_seen = [_find_state(each) for each in beside]
        self._looked_s = time.time()

    async def run(self) -> None:
        """Check the files twice a second, until cancelled."""
        while True:
            await asyncio.sleep(LOOK_S)
            try:
                await self.check_file(time.time())
            except Exception as e:  # a bug in the relay: try again
                log.error("%s can't be watched", self._path, exc_info=e)

    async def check_file(self, unix_s: float) -> None:
        """Check the files once, and call `changed` if needed. `unix_s`: the present time in unix seconds."""
        before = self.robots
        has_expired = before.list_publishers(self._looked_s) != before.list_publishers(unix_s)
        self._looked_s = unix_s
        seen = _find_state(self._path)
        if seen != self._seen or self._must_retry:
            await self._reread(is_new=seen != self._seen)
            self._seen = seen
        if self._has_new_beside() or has_expired or self.robots != before:
            self._is_due, self._pause = True, 0
        if self._is_due and self._pause == 0:
            await self._apply()
        elif self._is_due:
            self._pause -= 1

    async def _apply(self) -> None:
        try:
            await self._changed(self.robots)
        except Exception as e:
            self._pause = self._pauses = min(2 * self._pauses + 1, PAUSE_MAX)
            if str(e) != self.failure:
                is_bug = not isinstance(e, OSError)
                log.error(
                    "%s: its last change is not in force: %s; retrying",
                    self._path,
                    repr(e) if is_bug else e,
                    exc_info=e if is_bug else None,
                )
            self.failure = str(e)
            return
        self._is_due, self._pauses = False, 0
        if self.failure is not None:
            self.failure = None
            log.warning("%s: its last change is in force", self._path)

    async def _reread(self, is_new: bool) -> None:
        try:
            self.robots = await asyncio.to_thread(self._read, self._path)
        except RobotsError as e:
            self._must_retry = isinstance(e, UnreadableError)
            if is_new or str(e) != self.trouble:
                self.refused += 1
                log.warning("%s; its last good version stays in force", e)
            self.trouble = str(e)
            return
        self._must_retry = False
        if self.trouble is not None:
            self.trouble = None
            log.warning("%s: is valid again", self._path)

    def _has_new_beside(self) -> bool:
        """Whether a file `beside` has a new version that has stayed the same for one check: a certificate and
        its key are written one after the other.
        """
        before, self._beside_seen = self._beside_seen, [_find_state(each) for each in self._beside]
        if self._beside_seen == self._beside_taken or self._beside_seen != before:
            return False
        self._beside_taken = self._beside_seen
        return True


def _find_state(path: Path) -> FileState | None:
    """Return a value that changes with the file's content, owner or mode; None if the file is missing."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino, found.st_ctime_ns
