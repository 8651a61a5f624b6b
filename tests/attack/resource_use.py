"""A process's use of its machine, from Linux's accounts."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path


class ResourceUse:
    """The resources it has used since this object was made: 10⁶ bytes; seconds of its main thread."""

    def __init__(self, pid: int) -> None:
        self._at = Path(f"/proc/{pid}")
        self._waited_s = self._wait_s()
        (self._at / "clear_refs").write_text("5")  # resets the peak
        self._before_mb = self._figure("VmRSS")

    def _figure(self, name: str) -> float:
        found = re.search(rf"^{name}:\s+(\d+) kB", (self._at / "status").read_text(), re.MULTILINE)
        return int(found[1]) * 1024 / 1e6 if found else 0.0

    def _wait_s(self) -> float:
        ready_s = int((self._at / "schedstat").read_text().split()[1]) / 1e9
        stolen = int(Path("/proc/stat").read_text().split(maxsplit=9)[8])  # by other virtual machines
        return ready_s + stolen / os.sysconf("SC_CLK_TCK") / (os.cpu_count() or 1)

    def waited_s(self) -> float:
        """Seconds for which it wanted to compute but got no core; 0 once it is gone."""
        with suppress(OSError):
            return self._wait_s() - self._waited_s
        return 0.0

    def growth_mb(self) -> float:
        """The most it has held; 0 when it is gone."""
        with suppress(OSError):
            return max(0.0, self._figure("VmHWM") - self._before_mb)
        return 0.0
