"""Relays, innocent robots and viewers, attackers: the processes of one scene, all killed at its end."""

from __future__ import annotations

import json
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from subprocess import PIPE
from typing import Any

from posecast_testing import Process

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "spa/dist"
SERVING = re.compile(r"serving http://(\S+), robots (?:on tcp/(\S+)|from Redis)")
SECRETS = {name: name[0] * 43 for name in ("innocent", "newcomer", "rude")}
HERE = "tests.attack"


@dataclass
class Arena:
    """The running processes. `relay_command` starts the attacked relay, perhaps of another version."""

    folder: Path
    relay_command: tuple[str, ...]
    guarded: bool = False
    parts: list[Process] = field(default_factory=list)
    _numbers: Iterator[int] = field(default_factory=count)  # several threads may start parts
    screen_program: Path = ROOT / "tests/faults/screen.py"

    def start(self, name: str, *command: str) -> Process:
        """A process that ends with the arena."""
        part = Process(self.folder, f"{next(self._numbers)}-{name}", *command, stdin=PIPE)
        self.parts.append(part)
        return part

    def module(self, name: str, *arguments: str, nice: bool = False) -> Process:
        """A program of this suite. `nice`: an attacker has its own machine in reality; here it gets only the
        rest of the CPU."""
        first = ("nice", "-n", "19") if nice else ()
        return self.start(name, *first, sys.executable, "-m", f"{HERE}.{name}", *arguments)

    def relay(self, *flags: str) -> tuple[Process, str, str]:
        """(process, HOST:PORT of HTTP, of Zenoh)."""
        command = [*self.relay_command, "run", "--port", "0", "--zenoh-listen", "tcp/127.0.0.1:0", *flags]
        command += ["--past", "memory:"]
        command += ["--robots", str(self._robots())] if self.guarded else ["--dev"]
        if (PAGE / "index.html").is_file():
            command += ["--static", str(PAGE)]
        part = self.start("relay", *command)
        found = part.line(SERVING.pattern)
        return part, found[1], found[2] or ""

    def _robots(self) -> Path:
        file = self.folder / "robots.toml"
        tables = [
            f'[robots.{name}]\nsecret = "{secret}"\n[robots.{name}.anyone]\n'
            for name, secret in SECRETS.items()
        ]
        file.write_text("".join(tables))
        file.chmod(0o600)
        return file

    def secret(self, robot: str) -> list[str]:
        """For a command line; nothing where none is asked for."""
        return [SECRETS[robot]] if self.guarded else []

    def agent(self, *arguments: str) -> Process:
        """The agent that stands beside the relay's command."""
        *first, relay = self.relay_command
        return self.start("edge", *first, str(Path(relay).with_name("posecast-edge")), "run", *arguments)

    def robot(self, zenoh: str, name: str = "innocent") -> Process:
        """An innocent robot."""
        return self.module("innocent_robot", zenoh, name, *self.secret(name))

    def screen(self, http: str, name: str = "innocent") -> Process:
        """A viewer of it, behaving like the page."""
        return self.start(
            "screen", sys.executable, str(self.screen_program), f"ws://{http}/api/v1/robots/{name}/live?hz=60"
        )


@contextmanager
def arena(relay_command: tuple[str, ...], guarded: bool = False) -> Iterator[Arena]:
    """Everything started in it is killed at the end."""
    with tempfile.TemporaryDirectory(prefix="attack-") as folder:
        made = Arena(Path(folder), relay_command, guarded)
        try:
            yield made
        finally:
            for part in reversed(made.parts):
                if part.process.stdin is not None:
                    with suppress(OSError):
                        part.process.stdin.close()
                part.kill()


def said(part: Process, member: str) -> list[dict[str, Any]]:
    """Its lines of JSON with this member."""
    lines = (json.loads(line) for line in part.out.splitlines() if f'"{member}"' in line)
    return [line for line in lines if member in line]
