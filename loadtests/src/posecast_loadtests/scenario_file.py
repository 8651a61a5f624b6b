"""The locustfile of a named scenario: its users, and how many of them at which time.

locust -f loadtests/src/posecast_loadtests/scenario_file.py --headless --scenario lecture -H ws://127.0.0.1:8080
"""

from __future__ import annotations

import json
import subprocess
import sys
from itertools import pairwise
from typing import Any

from locust import FastHttpUser, LoadTestShape, User, between, events, task
from locust.env import Environment

from posecast_loadtests.scenarios import Stage
from posecast_loadtests.user import ViewerUser, scenario

__all__ = ["BrowserUser", "PublisherUser", "Stages", "ViewerUser"]

API = "/api/v1/robots"
FLEET_FIRST_S = 3.0  # robots come online before the first viewer


class BrowserUser(FastHttpUser):
    """A new visitor about every second, who opens the list, then a robot with its model."""

    fixed_count = 2
    wait_time = between(0.5, 1.5)

    def __init__(self, environment: Environment) -> None:
        self.host = (environment.host or "").replace("ws://", "http://").replace("wss://", "https://")
        super().__init__(environment)
        options = environment.parsed_options
        assert options is not None
        self._robot = "fleet-0" if scenario(environment).robots else options.robot

    @task
    def visit(self) -> None:
        """Make the requests in the order of the page."""
        self._get(API, "list")
        found = self._get(f"{API}/{self._robot}", "robot")
        self._get(f"{API}/{self._robot}/state", "state")
        model = found.get("model")
        if model:
            manifest = self._get(f"{API}/{self._robot}/model/{model}/manifest.json", "manifest")
            for level in list(manifest.get("levels", []))[:1]:  # the level that a phone fetches first
                path = f"{API}/{self._robot}/model/{model}/{level['path']}"
                self._get(path, "lowest level", parse=False)

    def _get(self, path: str, name: str, parse: bool = True) -> dict[str, Any]:
        with self.client.get(path, name=name, catch_response=True) as answer:
            if answer.status_code != 200:
                answer.failure(f"status {answer.status_code}")
                return {}
            answer.success()
            return dict(answer.json()) if parse else {}


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


class Stages(LoadTestShape):
    """Follows the scenario's stages; ends the test after the last."""

    def tick(self) -> tuple[int, float, list[type[User]]] | None:
        """Return the number of users, the new ones per second and their classes; None at the end."""
        assert self.runner is not None
        asked = scenario(self.runner.environment)
        users: list[type[User]] = [ViewerUser, BrowserUser]
        others = BrowserUser.fixed_count
        at_s: float = self.get_run_time()  # type: ignore[no-untyped-call]
        if asked.robots:
            users.append(PublisherUser)
            others += PublisherUser.fixed_count
            at_s -= FLEET_FIRST_S
            if at_s < 0:
                return PublisherUser.fixed_count, 1.0, [PublisherUser]
        for before, stage in pairwise((Stage(0.0, 0.0), *asked.stages)):
            if at_s < stage.until_s:
                arriving = (stage.share - before.share) * asked.viewers / (stage.until_s - before.until_s)
                return round(stage.share * asked.viewers) + others, max(1.0, arriving), users
        return None


def _arguments(parser: Any) -> None:
    parser.add_argument("--zenoh", default="tcp/127.0.0.1:7447", help="where the fleet's robots connect")


_hooks: Any = events
_hooks.init_command_line_parser.add_listener(_arguments)
