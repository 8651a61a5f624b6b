"""The HTTP requests of a browser next to the stream: list, robot, state, model."""

from __future__ import annotations

from typing import Any

from locust import FastHttpUser, between, task
from locust.env import Environment

from posecast_loadtests.user import scenario

API = "/api/v1/robots"


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
