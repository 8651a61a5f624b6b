"""The processes that one command starts and ends together."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from types import TracebackType

POLL_S = 0.1
END_S = 5.0  # then a process that goes on is killed
ENDINGS = ("SIGINT", "SIGTERM", "SIGHUP")  # Ctrl-C, kill, a closed terminal; Windows has no SIGHUP


def _stop(_signum: int, _frame: object) -> None:
    raise KeyboardInterrupt


def obey_endings() -> None:
    """Let each signal that ends this process raise KeyboardInterrupt, also where a shell had it ignored."""
    for name in ENDINGS:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), _stop)


class Processes:
    """Programs of Posecast, ended at the end of a `with` block in the reverse order of their start."""

    def __init__(self) -> None:
        self._started: list[subprocess.Popen[bytes]] = []

    def __enter__(self) -> Processes:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for name in ENDINGS:  # a second Ctrl-C would leave some of them running
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), signal.SIG_IGN)
        for process in reversed(self._started):
            if process.poll() is None:
                process.terminate()
        for process in reversed(self._started):
            try:
                process.wait(timeout=END_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def start(
        self, command: Sequence[str], *, read: int | None = None, environment: Mapping[str, str] | None = None
    ) -> subprocess.Popen[bytes]:
        """Start `posecast COMMAND …`. `read`: subprocess.PIPE for what it writes to stdout. It has a session
        of its own: Ctrl-C reaches only this process, which ends the others in order."""
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "posecast_command", *command],
            stdout=read,
            start_new_session=True,
            env=environment,
        )
        self._started.append(process)
        return process

    def start_until(
        self, command: Sequence[str], word: bytes, limit_s: float, environment: Mapping[str, str]
    ) -> tuple[subprocess.Popen[bytes], bool]:
        """Likewise, and wait until it has written a word to stdout; False where it ended before, or took
        longer. What it writes is not shown."""
        process = self.start(command, read=subprocess.PIPE, environment=environment)
        written = threading.Event()

        def read() -> None:
            assert process.stdout is not None
            for line in process.stdout:  # to its end, so that the pipe is never full
                if word in line:
                    written.set()

        threading.Thread(target=read, name="stdout", daemon=True).start()
        give_up_s = time.monotonic() + limit_s
        while not written.wait(POLL_S):
            if self.find_ended() is not None or time.monotonic() > give_up_s:
                return process, False
        return process, True

    def find_ended(self) -> subprocess.Popen[bytes] | None:
        """The first process that has ended; None while all of them run."""
        return next((process for process in self._started if process.poll() is not None), None)

    def forget(self, process: subprocess.Popen[bytes]) -> None:
        """Go on without a process that has ended."""
        self._started.remove(process)
