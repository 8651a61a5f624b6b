"""Runs an agent in threads of the user's program. It ends with the program and never delays it."""

from __future__ import annotations

import atexit
import logging
import os
import threading
from typing import ClassVar

from posecast_edge.agent import Agent
from posecast_edge.model.serve.background import BackgroundBuild
from posecast_edge.sources.published.source import PublishedSource

log = logging.getLogger("posecast_edge.robot")

LAST_SAMPLE_S = 0.5  # time to send the newest readings
STOP_S = 1.5
# A thread that returns from Zenoh into Python during interpreter shutdown aborts the process: wait for it
LINK_S = 3.0


class NoProgressLine:
    """Shows no status line."""

    def is_due(self, now_s: float) -> bool:
        """Never."""
        del now_s
        return False

    def show_progress(self, text: str, now_s: float) -> None:
        """Nothing."""

    def finish(self) -> None:
        """Nothing."""


class BackgroundAgent:
    """The agent's threads. Holds no reference to the Robot object, so that Python can garbage-collect it."""

    # Zenoh's threads don't survive a fork, so a forked process can never open a link
    _zenoh_pid: ClassVar[int | None] = None

    def __init__(self, agent: Agent, source: PublishedSource, build: BackgroundBuild | None) -> None:
        self._agent, self._source, self._build = agent, source, build
        self._pid = os.getpid()
        self._thread = threading.Thread(target=self._run, name="posecast", daemon=True)

    @property
    def frames(self) -> int:
        """How many frames have been sent."""
        return self._agent.frames

    def describe_link(self) -> str:
        """The state of the link in a few words."""
        return self._agent.describe_link() if self._thread.is_alive() else "closed"

    def start(self) -> None:
        """Start the threads. Raises RuntimeError in a process forked from one that has started them."""
        if BackgroundAgent._zenoh_pid not in (None, self._pid):
            raise RuntimeError(
                "this process was forked from one that had a Robot, and the link does not survive a fork: "
                "use the multiprocessing start method 'spawn'"
            )
        BackgroundAgent._zenoh_pid = self._pid
        atexit.register(self._close_at_exit)
        self._thread.start()
        if self._build is not None:
            self._build.start()

    def is_fork(self) -> bool:
        """Whether this process is a fork of the one that has the threads."""
        return os.getpid() != self._pid

    def abandon(self) -> None:
        """Ask all threads to end soon. Takes no lock, because the garbage collector may call it at any point
        in any thread."""
        self._source.end()

    def close(self) -> None:
        """Send the newest readings if the link is up, then end. Takes about a second at most. Does nothing
        in a fork of the process."""
        if self.is_fork():
            return
        self._source.end()
        self._thread.join(LAST_SAMPLE_S)
        self._agent.stop()
        self._thread.join(STOP_S)

    def _close_at_exit(self) -> None:
        if self.is_fork():
            return
        self.close()
        self._agent.wait_for_link_end(LINK_S)

    def _run(self) -> None:
        try:
            self._agent.run()
        except Exception as e:
            log.warning("the agent has ended: %s: %s", type(e).__name__, e)
            log.debug("the agent", exc_info=e)
        finally:
            if self._build is not None:
                self._build.stop()
            # after garbage collection nobody holds a reference
            self._agent.wait_for_link_end(LINK_S)
            atexit.unregister(self._close_at_exit)
