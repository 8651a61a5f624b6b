"""Runs a command with a time limit and reports its cost, including its children."""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass

LIMIT_S = 60.0
SAID_MAX = 1 << 20  # maximum bytes of output read


@dataclass(frozen=True)
class Outcome:
    """How a command ended. `status`: its exit status, None if it was stopped at the limit; `rss_mb`: memory
    of the largest process. The kernel's figure includes the size of the parent at the start, so keep the
    parent small."""

    status: int | None
    wall_s: float
    cpu_s: float
    rss_mb: float
    out: str
    err: str


def run_measured(command: Sequence[str], limit_s: float = LIMIT_S) -> Outcome:
    """Run a command to its end or until `limit_s` have passed."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        start = time.monotonic()
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=out, stderr=err, start_new_session=True
        )
        late = threading.Event()

        def stop() -> None:
            late.set()
            os.killpg(process.pid, signal.SIGKILL)

        timer = threading.Timer(limit_s, stop)
        timer.start()
        try:
            _, status, used = os.wait4(process.pid, 0)
        finally:
            timer.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        said = []
        for file in (out, err):
            file.seek(0)
            said.append(file.read(SAID_MAX).decode(errors="replace"))
        return Outcome(
            None if late.is_set() else process.returncode,
            time.monotonic() - start,
            used.ru_utime + used.ru_stime,
            used.ru_maxrss / 1024,
            *said,
        )
