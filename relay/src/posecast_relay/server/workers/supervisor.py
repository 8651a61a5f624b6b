"""Starts the further workers, restarts those that exit, and stops all of them with the first one."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace as replaced

from posecast_relay.server.workers.shared_counts import SharedCounts
from posecast_relay.server.workers.worker_place import WorkerPlace

log = logging.getLogger("posecast_relay")

MODULE = "posecast_relay.server.workers.further"
POLL_S = 0.05
BACKOFF_S = (0.2, 10.0)  # first and longest wait before a worker is started again
HUNG_POLLS = round(
    15.0 / POLL_S
)  # one that gives no sign of life in so many looks is ended, and started again
SETTLED_S = 30.0  # a worker that ran this long is restarted without a longer wait
DRAIN = b"d"


@dataclass
class _Child:
    process: subprocess.Popen[bytes]
    control: socket.socket


class Supervisor:
    """The further workers of a relay. `argv`: the relay's arguments. `place`: a template for their places."""

    def __init__(self, argv: Sequence[str], place: WorkerPlace, counts: SharedCounts) -> None:
        self._argv = list(argv)
        self._place = place
        self._counts = counts
        self._children: dict[int, _Child] = {}
        self._leaving = False
        self._tasks: list[asyncio.Task[None]] = []
        self.restarts = 0

    def start(self) -> None:
        """Start all workers and keep them running."""
        for number in range(1, self._place.workers):
            self._tasks.append(asyncio.create_task(self._keep(number), name=f"worker {number}"))

    def drain(self) -> None:
        """Tell the workers to move their viewers away and exit; none is restarted."""
        self._leaving = True
        for child in self._children.values():
            with contextlib.suppress(OSError):
                child.control.send(DRAIN)

    def kill(self) -> None:
        """Kill all workers at once."""
        self._leaving = True
        for child in self._children.values():
            child.process.kill()

    @property
    def is_over(self) -> bool:
        """Whether all workers were told to exit, and have exited."""
        return self._leaving and all(child.process.poll() is not None for child in self._children.values())

    def stop(self) -> None:
        """Kill the remaining workers, and stop supervising them."""
        self.kill()
        for task in self._tasks:
            task.cancel()
        for child in self._children.values():
            child.process.wait()
            child.control.close()

    async def _keep(self, number: int) -> None:
        wait_s = BACKOFF_S[0]
        while not self._leaving:
            began = time.monotonic()
            try:
                child = self._children[number] = self._spawn(number)
            except OSError as e:
                log.error("worker %d can't be started: %s", number, e)
            else:
                await self._watch(number, child.process)
                child.control.close()
                del self._children[number]
                self._counts.clear(number)
                if self._leaving:
                    return
                log.error("worker %d exited with status %d: restarting it", number, child.process.returncode)
            if time.monotonic() - began > SETTLED_S:
                wait_s = BACKOFF_S[0]
            await asyncio.sleep(wait_s)
            self.restarts += not self._leaving
            wait_s = min(2 * wait_s, BACKOFF_S[1])

    async def _watch(self, number: int, process: subprocess.Popen[bytes]) -> None:
        """Return when a process has exited. Kill one that hangs: the kernel still gives it connections.

        This counts checks, not seconds, so that pausing the whole relay (Ctrl-Z) kills no worker.
        """
        beat, silent = self._counts.get_beat(number), 0
        while process.poll() is None:
            await asyncio.sleep(POLL_S)
            before, beat = beat, self._counts.get_beat(number)
            silent = 0 if beat is None or beat != before else silent + 1
            if silent >= HUNG_POLLS and not self._leaving:
                log.error("worker %d does not respond: killing it", number)
                process.kill()
                silent = 0

    def _spawn(self, number: int) -> _Child:
        """Start a worker, in the main thread: it dies with the thread that starts it. Raises OSError."""
        ours, theirs = socket.socketpair()
        with theirs:
            ours.setblocking(False)
            place = replaced(self._place, number=number, control=theirs.fileno())
            command = [sys.executable, "-P", "-m", MODULE, place.pack(), *self._argv]
            try:
                process = subprocess.Popen(
                    command,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    pass_fds=(place.counts, place.control),
                )
            except OSError:
                ours.close()
                raise
        return _Child(process, ours)
