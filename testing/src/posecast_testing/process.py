"""A program that a test, benchmark or load test starts, and that ends with it."""

from __future__ import annotations

import re
import signal
import subprocess
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from .waits import until

GRACE_S = 10.0


class Process:
    """One process. Its stdout and stderr go to files in `folder`, so that it never waits for a reader."""

    def __init__(
        self,
        folder: Path,
        name: str,
        *command: str,
        stdin: int | None = None,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        """`stdin`: a file descriptor or `subprocess.PIPE`. `environment`: instead of this process's."""
        self.name = name
        self._paths = [folder / f"{name}.out", folder / f"{name}.err"]
        with self._paths[0].open("ab") as out, self._paths[1].open("ab") as err:
            self.process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL if stdin is None else stdin,
                stdout=out,
                stderr=err,
                env=environment,
            )

    def line(self, pattern: str, deadline_s: float = 60.0) -> re.Match[str]:
        """Wait for a line of stdout that matches, and return the newest. Fails when the process has ended."""

        def found() -> re.Match[str] | None:
            has_ended = self.process.poll() is not None
            matches = list(re.finditer(pattern, self.out, re.MULTILINE))
            assert matches or not has_ended, f"{self.name} has ended:\n{self.log}"
            return matches[-1] if matches else None

        return until(f"{self.name} prints {pattern}", found, deadline_s)

    @property
    def out(self) -> str:
        """Its stdout so far, whole lines."""
        text = self._paths[0].read_text()
        return text[: text.rfind("\n") + 1]

    def errors(self) -> str:
        """Its stderr so far."""
        return self._paths[1].read_text()

    @property
    def log(self) -> str:
        """Both outputs."""
        return "\n".join(f"--- {path.name}\n{path.read_text()}" for path in self._paths)

    def kill(self) -> None:
        """Send SIGKILL and wait for the end."""
        self.process.kill()
        self.process.wait()

    def stop(self, how: signal.Signals = signal.SIGTERM) -> int:
        """End it, if need be by SIGKILL after 10 s. Returns its exit status."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.send_signal(how)
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(GRACE_S)
        if self.process.poll() is None:
            self.kill()
        if self.process.stdin is not None:
            with suppress(BrokenPipeError):
                self.process.stdin.close()
        return self.process.returncode
