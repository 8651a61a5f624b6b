"""Watches the file of `--robots` while the relay runs, and the credentials in it that expire."""

from __future__ import annotations

import asyncio
import logging
import os
import time
from collections.abc import Awaitable, Callable
from pathlib import Path

from posecast_relay.config.robots_file import read_robots
from posecast_relay.config.robots_reader import Robots, RobotsError

log = logging.getLogger("posecast_relay")

LOOK_S = 0.5


class RobotsWatcher:
    """Calls `changed` with the robots whenever the file has changed or a credential has expired.

    A file that is wrong, gone or empty (an editor has just begun to write it, or the disk is full) changes
    nothing: what was read last stays in force, and one line of the log says so.
    """

    def __init__(
        self,
        path: Path,
        robots: Robots,
        changed: Callable[[Robots], Awaitable[None]],
        read: Callable[[Path], Robots] = read_robots,
    ) -> None:
        self.robots = robots
        self.refused = 0  # times that the file was wrong
        self._path = path
        self._changed = changed
        self._read = read
        self._seen = _state(path)
        self._looked_s = time.time()

    async def run(self) -> None:
        """Check the file twice a second, until cancelled."""
        while True:
            await asyncio.sleep(LOOK_S)
            try:
                await self.check_file(time.time())
            except Exception as e:  # a mistake of ours: the next change is followed again
                log.error("%s can't be followed", self._path, exc_info=e)

    async def check_file(self, unix_s: float) -> None:
        """Check the file once, and call `changed` if need be. `unix_s` is the time now, in unix seconds."""
        seen = _state(self._path)
        expired = self.robots.list_publishers(self._looked_s) != self.robots.list_publishers(unix_s)
        self._looked_s = unix_s
        if seen != self._seen:
            self._seen = seen
            try:
                if seen is not None and seen[1] == 0:
                    raise RobotsError(f"{self._path}: is empty; for no robots at all, leave a comment in it")
                self.robots = await asyncio.to_thread(self._read, self._path)
            except RobotsError as e:
                self.refused += 1
                log.warning("%s; going on with what it said before", e)
                return
        elif not expired:
            return
        await self._changed(self.robots)


def _state(path: Path) -> tuple[int, int, int, int] | None:
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino, found.st_mode
