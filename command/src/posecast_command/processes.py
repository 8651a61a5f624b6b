"""The processes that one command starts and stops together."""

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
END_S = 5.0  # then a process that is still running is killed
ENDINGS = ("SIGINT", "SIGTERM", "SIGHUP")  # Ctrl-C, kill, a closed terminal; Windows has no SIGHUP


class Processes:
    """Programs that run side by side. The end of the `with` block stops them in reverse order of their start.

    Inside the block, the signals that end this process only make `start_until` and `pause` raise
    KeyboardInterrupt; that includes signals the shell ignored. So a signal during a start, or a second
    signal, leaves no program running.
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
        """Start a program. `read`: subprocess.PIPE to read its stdout; `environment` and `folder`: None for
        those of this process. The program gets its own session: Ctrl-C reaches only this process, which
        stops the others in order."""
        process = subprocess.Popen(command, stdout=read, start_new_session=True, env=environment, cwd=folder)
        self._started.append(process)
        return process

    def start_until(
        self, command: Sequence[str], word: bytes, limit_s: float, environment: Mapping[str, str]
    ) -> tuple[subprocess.Popen[bytes], bool]:
        """Start a program as `start` does, and wait until it writes `word` to stdout. The boolean is False
        when it ended first or took longer than `limit_s`. Its stdout is not shown. Raises KeyboardInterrupt
        when a signal told this process to end."""
        process = self.start(command, read=subprocess.PIPE, environment=environment)
        written = threading.Event()

        def read() -> None:
            assert process.stdout is not None
            for line in process.stdout:  # keep reading, so that the pipe never fills
                if word in line:
                    written.set()

        reader = threading.Thread(target=read, name="stdout", daemon=True)
        reader.start()
        give_up_s = time.monotonic() + limit_s
        while not written.wait(POLL_S):
            self._obey_ending()
            if self.find_ended() is not None or time.monotonic() > give_up_s:
                if process.poll() is not None:
                    reader.join(END_S)  # what it wrote last
                return process, written.is_set()
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
        # don't raise: the interrupted code may hold a lock, or a process that is not in the list yet
        self._is_to_end = True

    def _obey_ending(self) -> None:
        if self._is_to_end:
            raise KeyboardInterrupt


def name_program(*arguments: str) -> list[str]:
    """The command line of `posecast` with these arguments, as it is installed here."""
    return [sys.executable, "-P", "-m", "posecast_command", *arguments]
