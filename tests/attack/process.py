"""What a process takes of its machine, as Linux tells it."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path


class Process:
    """What it took of its machine since this was made. 10⁶ bytes; of its main thread, s."""

    def __init__(self, pid: int) -> None:
        self._at = Path(f"/proc/{pid}")
        self._waited_s = self._wait_s()
        (self._at / "clear_refs").write_text("5")  # the peak begins anew
        self._before_mb = self._figure("VmRSS")

    def _figure(self, name: str) -> float:
        found = re.search(rf"^{name}:\s+(\d+) kB", (self._at / "status").read_text(), re.MULTILINE)
        return int(found[1]) * 1024 / 1e6 if found else 0.0

    def _wait_s(self) -> float:
        ready_s = int((self._at / "schedstat").read_text().split()[1]) / 1e9
        stolen = int(Path("/proc/stat").read_text().split(maxsplit=9)[8])  # by other virtual machines
        return ready_s + stolen / os.sysconf("SC_CLK_TCK") / (os.cpu_count() or 1)

    def waited_s(self) -> float:
        """How long it would have computed and had no core, or its cores were not there; 0 when it is gone."""
        with suppress(OSError):
            return self._wait_s() - self._waited_s
        return 0.0

    def growth_mb(self) -> float:
        """The most it has held; 0 when it is gone."""
        with suppress(OSError):
            return max(0.0, self._figure("VmHWM") - self._before_mb)
        return 0.0
