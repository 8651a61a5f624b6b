"""One cloud for all tests in this folder: built, started, stopped."""

from __future__ import annotations

import json
import ssl
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import free_port

from tests.compose.engine import ROOT, Project, docker

BUILD_S = 1500.0
START_S = 180.0


@dataclass
class Cloud:
    """A running project and the address of its page."""

    project: Project
    authority: Path  # the proxy's own
    trust: ssl.SSLContext
    seconds_to_move: float

    @property
    def url(self) -> str:
        """The proxy's."""
        return f"https://localhost:{self.project.https_port}"

    def get(self, path: str) -> Any:
        """JSON from behind the proxy. OSError."""
        with urllib.request.urlopen(self.url + path, timeout=5, context=self.trust) as answer:
            return json.load(answer)

    def ask_admin(self, secret: str, method: str = "GET", path: str = "") -> Any:
        """What /api/v1/admin answers to the proxy's own page. HTTPError."""
        headers = {"authorization": f"Bearer {secret}", "origin": self.url}
        asked = urllib.request.Request(f"{self.url}/api/v1/admin{path}", method=method, headers=headers)
        with urllib.request.urlopen(asked, timeout=10, context=self.trust) as answer:
            return json.load(answer)

    def status(self, robot: str) -> str | None:
        """The relay's entry for a robot; None if it does not know that name."""
        try:
            return str(self.get(f"/api/v1/robots/{robot}")["status"])
        except OSError:
            return None

    def until_moves(self, deadline_s: float = 60.0) -> float:
        """Seconds until the demo robot has been seen in five poses."""
        began_s, poses = time.monotonic(), set[str]()
        while len(poses) < 5:
            assert time.monotonic() - began_s < deadline_s, f"the robot does not move within {deadline_s:g} s"
            try:
                state = self.get("/api/v1/robots/demo/state")
                poses.add(json.dumps(state["fields"]["pos"]["values"]))
            except OSError:
                pass
            time.sleep(0.05)
        return time.monotonic() - began_s


@pytest.fixture(scope="session")
def cloud(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cloud]:
    folder = tmp_path_factory.mktemp("compose")
    try:
        project = Project(folder, (free_port(), free_port(), free_port(), free_port()))
    except LookupError as e:
        pytest.skip(str(e))
    subprocess.run([ROOT / "tests/compose/base_images.sh"], check=True, timeout=BUILD_S)
    try:
        project.compose("build", limit_s=BUILD_S)
        began_s = time.monotonic()
        project.compose("--profile", "demo", "up", "--detach", "--wait", limit_s=START_S)
        (proxy,) = project.containers("proxy")
        root = folder / "root.crt"
        root.write_text(docker("exec", proxy, "cat", "/caddy/data/caddy/pki/authorities/local/root.crt"))
        made = Cloud(project, root, ssl.create_default_context(cafile=str(root)), 0.0)
        made.until_moves()
        made.seconds_to_move = time.monotonic() - began_s
        yield made
    finally:
        logs = project.compose("--profile", "*", "logs", "--no-color", "--tail", "30")
        print(logs)  # pytest shows it when a test has failed
        project.compose("--profile", "*", "down", "--volumes", "--timeout", "10", limit_s=180)
