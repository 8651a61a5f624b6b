"""The processes that one command starts and ends together."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

POLL_S = 0.1
END_S = 5.0  # then a process that goes on is killed
ENDINGS = ("SIGINT", "SIGTERM", "SIGHUP")  # Ctrl-C, kill, a closed terminal; Windows has no SIGHUP


class Processes:
    """Programs that run side by side, ended at the end of a `with` block in the reverse order of their start.

    Inside the block the signals that end this process, also those that a shell had ignored, only make
    `start_until` and `pause` raise KeyboardInterrupt. So a signal that comes while a program is being
    started, or a second signal, leaves none of them running.
    """

    def __init__(self) -> None:
        self._started: list[subprocess.Popen[bytes]] = []
        self._handlers: dict[int, Any] = {}  # before the block
        self._is_to_end = False

    def __enter__(self) -> Processes:
        for name in ENDINGS:
            if hasattr(signal, name):
                number = getattr(signal, name)
                self._handlers[number] = signal.signal(number, self._note_ending)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for process in reversed(self._started):
            if process.poll() is None:
                process.terminate()
        for process in reversed(self._started):
            try:
                process.wait(timeout=END_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        for number, handler in self._handlers.items():
            signal.signal(number, handler or signal.SIG_DFL)

    def start(
        self,
        command: Sequence[str],
        *,
        read: int | None = None,
        environment: Mapping[str, str] | None = None,
        folder: Path | None = None,
    ) -> subprocess.Popen[bytes]:
        """Start a program. `read`: subprocess.PIPE for what it writes to stdout; `environment` and `folder`:
        None for those of this process. It has a session of its own: Ctrl-C reaches only this process, which
        ends the others in order."""
        process = subprocess.Popen(command, stdout=read, start_new_session=True, env=environment, cwd=folder)
        self._started.append(process)
        return process

    def start_until(
        self, command: Sequence[str], word: bytes, limit_s: float, environment: Mapping[str, str]
    ) -> tuple[subprocess.Popen[bytes], bool]:
        """Start a program as `start` does, and wait until it has written `word` to stdout: True then, False
        where it ended before or took longer than `limit_s`. What it writes to stdout is not shown. Raises
        KeyboardInterrupt when a signal has told this process to end."""
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
            self._obey_ending()
            if self.find_ended() is not None or time.monotonic() > give_up_s:
                return process, False
        return process, True

    def pause(self) -> None:
        """Wait for POLL_S. Raises KeyboardInterrupt when a signal has told this process to end."""
        time.sleep(POLL_S)
        self._obey_ending()

    def find_ended(self) -> subprocess.Popen[bytes] | None:
        """The first process that has ended; None while all of them run."""
        return next((process for process in self._started if process.poll() is not None), None)

    def forget(self, process: subprocess.Popen[bytes]) -> None:
        """Go on without a process that has ended."""
        self._started.remove(process)

    def _note_ending(self, _signum: int, _frame: object) -> None:
        # it raises nothing: what it interrupts may hold a lock, or a process that is not in the list yet
        self._is_to_end = True

    def _obey_ending(self) -> None:
        if self._is_to_end:
            raise KeyboardInterrupt


def name_program(*arguments: str) -> list[str]:
    """The command line of `posecast` with these arguments, as it is installed here."""
    return [sys.executable, "-P", "-m", "posecast_command", *arguments]
