"""Locust's fleet: one user that runs a process of robots and reports how it does."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

from locust import User, task
from locust.env import Environment

from posecast_loadtests.user import scenario


class PublisherUser(User):
    """Runs all robots in a separate process: Zenoh's threads and gevent do not mix."""

    fixed_count = 1

    def __init__(self, environment: Environment) -> None:
        super().__init__(environment)
        options = environment.parsed_options
        assert options is not None
        self._command = [
            *(sys.executable, "-m", "posecast_loadtests.fleet", "--relay", options.zenoh),
            *("--robots", str(scenario(environment).robots), "--hz", str(options.source_hz)),
        ]
        self._process: subprocess.Popen[str] | None = None

    @task
    def publish(self) -> None:
        """Publish until the test ends. A second with late ticks counts as a failure: the generator is too
        slow."""
        self._process = subprocess.Popen(self._command, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        late = 0
        for line in self._process.stdout:
            told: dict[str, Any] = json.loads(line)
            more, late = told["late"] - late, told["late"]
            self._fire(told["frames"], RuntimeError(f"{more} late ticks") if more > 3 else None)
        self._fire(0, RuntimeError("the fleet has ended"))
        self._process.wait()

    def on_stop(self) -> None:
        """End the robots with the test."""
        if self._process is not None:
            self._process.kill()

    def _fire(self, frames: int, error: Exception | None) -> None:
        self.environment.events.request.fire(
            request_type="Zenoh",
            name="a second of the fleet",
            response_time=0.0,
            response_length=frames,
            exception=error,
            context={},
        )
