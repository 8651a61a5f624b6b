"""A Docker engine and Compose, if available, and a separate project on them."""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "infra" / "docker-compose.yml"


def compose_command() -> list[str]:
    """`docker compose`, or the standalone program of that version. LookupError says what is missing."""
    if shutil.which("docker") is None:
        raise LookupError("no docker here")
    answer = subprocess.run(["docker", "info"], capture_output=True, text=True, check=False, timeout=60)
    if answer.returncode != 0:
        raise LookupError("no Docker engine answers: " + answer.stderr.strip().splitlines()[-1])
    for command in (["docker", "compose"], [os.environ.get("DOCKER_COMPOSE", "docker-compose")]):
        if shutil.which(command[0]) is None:
            continue
        version = subprocess.run(
            [*command, "version", "--short"], capture_output=True, text=True, check=False
        )
        if version.returncode == 0 and version.stdout.strip().lstrip("v")[0] not in "01":
            return command
    raise LookupError(
        "no Compose 2 here: neither `docker compose` nor docker-compose (DOCKER_COMPOSE names it)"
    )


class Project:
    """One cloud: infra/docker-compose.yml under its own name and ports."""

    def __init__(self, folder: Path, ports: tuple[int, int, int, int]) -> None:
        self.name = f"posecast-test-{os.getpid()}"
        self.https_port, self.http_port, self.robots_port, prometheus_port = ports
        self.settings = {
            "BIND": "127.0.0.1",
            "HTTPS_PORT": str(self.https_port),
            "HTTP_PORT": str(self.http_port),
            "ROBOTS_PORT": str(self.robots_port),
            "PROMETHEUS_PORT": str(prometheus_port),
            # an engine in a sandbox may not give more than this process has
            "NOFILE": str(min(65536, resource.getrlimit(resource.RLIMIT_NOFILE)[1])),
        }
        self.program = compose_command()
        self._folder = folder
        # registries are reached through the machine's own network, wherever that leads
        self._here = folder / "here.yml"
        build = {"build": {"network": "host"}}
        self._here.write_text(json.dumps({"services": {"relay": build, "proxy": build}}))

    def write_command(self, **settings: str) -> list[str]:
        """The command for this project, with additional settings."""
        env_file = self._folder / ".env"
        env_file.write_text("".join(f"{k}={v}\n" for k, v in {**self.settings, **settings}.items()))
        named = ("--project-name", self.name, "--env-file", str(env_file))
        return [*self.program, *named, "-f", str(FILE), "-f", str(self._here)]

    def compose(self, *words: str, limit_s: float = 120, **settings: str) -> str:
        """Runs a command; returns its output. AssertionError with its output if it fails."""
        command = [*self.write_command(**settings), *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=limit_s)
        assert done.returncode == 0, f"compose {' '.join(words)}\n{done.stdout[-4000:]}{done.stderr[-8000:]}"
        return done.stdout

    def containers(self, service: str, running: bool = True) -> list[str]:
        """Ids of a service's containers."""
        state = ("--status", "running") if running else ("--all",)
        return self.compose("ps", *state, "--quiet", service).split()

    def inspect(self, container: str) -> dict[str, Any]:
        """What the engine knows of a container."""
        found: list[dict[str, Any]] = json.loads(docker("inspect", container))
        return found[0]


def docker(*words: str) -> str:
    """Runs a docker command; its output."""
    done = subprocess.run(["docker", *words], capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, f"docker {' '.join(words)}: {done.stderr}"
    return done.stdout
