"""Watches the file of `--robots` while the relay runs, and the credentials in it that expire."""

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

FileState = tuple[int, int, int, int]


class RobotsWatcher:
    """Calls `changed` with the robots whenever they have changed, a credential has expired, or one of the
    files beside them (certificates) is another one.

    A file that is wrong, can't be read, is gone or empty (an editor has just begun to write it, or the disk
    is full) changes nothing: what was read last stays in force. One line of the log says so for each change
    of the file, and another one when it is good again.
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
        self.refused = 0  # times that the file was wrong
        self.trouble: str | None = None  # what is wrong with the file now
        self._path = path
        self._changed = changed
        self._read = read
        self._seen: FileState | None = (0, 0, 0, 0)  # it may have changed since it was read: look again
        self._must_retry = False
        self._beside = beside
        self._beside_taken = self._beside_seen = [_find_state(each) for each in beside]
        self._looked_s = time.time()

    async def run(self) -> None:
        """Check the files twice a second, until cancelled."""
        while True:
            await asyncio.sleep(LOOK_S)
            try:
                await self.check_file(time.time())
            except Exception as e:  # a mistake of ours: the next change is followed again
                log.error("%s can't be followed", self._path, exc_info=e)

    async def check_file(self, unix_s: float) -> None:
        """Check the files once, and call `changed` if need be. `unix_s` is the time now, in unix seconds."""
        before = self.robots
        has_expired = before.list_publishers(self._looked_s) != before.list_publishers(unix_s)
        self._looked_s = unix_s
        seen = _find_state(self._path)
        if seen != self._seen or self._must_retry:
            await self._reread(is_new=seen != self._seen)
            self._seen = seen
        if self._has_new_beside() or has_expired or self.robots != before:
            await self._changed(self.robots)

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
            log.warning("%s: is good again", self._path)

    def _has_new_beside(self) -> bool:
        """Whether another version of a file beside it stands there, and has for one look: a certificate and
        its key are written one after the other.
        """
        before, self._beside_seen = self._beside_seen, [_find_state(each) for each in self._beside]
        if self._beside_seen == self._beside_taken or self._beside_seen != before:
            return False
        self._beside_taken = self._beside_seen
        return True


def _find_state(path: Path) -> FileState | None:
    """Return what differs between two versions of a file, and after a change of owner or mode; None when it
    is gone.
    """
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino, found.st_ctime_ns
