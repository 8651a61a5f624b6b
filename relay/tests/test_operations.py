"""The operator's page names what there is: every series, every flag it mentions, every link."""

from __future__ import annotations

import os
import pty
import re
import shlex
import subprocess
import sys
from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from posecast_relay.config.robots_file import read_robots
from posecast_relay.config.settings import FLAGS
from posecast_relay.core.breaker import Breaker
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.core.past.memory_store import MemoryPast
from posecast_relay.core.policy.policy import Audience, Rule
from posecast_relay.http.archive_metrics import ArchiveFigures
from posecast_relay.http.metrics import RelayCollector
from posecast_relay.http.past.held_requests import HeldRequests
from posecast_relay.redis.past_writer import RedisPastWriter
from posecast_relay.redis.store import RedisStore
from posecast_relay.runtime.dispatcher import Dispatcher
from posecast_relay.runtime.fan_out import FanOut
from posecast_relay.server.workers.metrics import LEAST, SUMMED, JoinedCollector

DOCS = Path(__file__).resolve().parents[2] / "docs"
ROBOTS_FLAGS = {  # of `posecast-relay robots`
    *("--ca", "--certificate", "--days", "--private", "--url"),
    *("--anyone", "--keep", "--link", "--signed-in", "--begin", "--finish", "--networks"),
}
PAST_FLAGS = {"--all", "--from", "--to", "--view", "--yes"}  # of `posecast-relay past`
EDGE_FLAGS = {"--credential", "--hz", "--relay", "--robot", "--tls-ca", "--tls-cert", "--tls-key"}
REDIS_FLAGS = {"--pattern", "--scan"}  # of redis-cli
COMPOSE_FLAGS = {  # of docker, docker compose and tar
    *(
        "--detach",
        "--env-file",
        "--format",
        "--interactive",
        "--network",
        "--no-deps",
        "--no-recreate",
        "--no-start",
    ),
    *("--numeric-owner", "--profile", "--project-name", "--quiet", "--rm", "--scale", "--user", "--volume"),
    *("--force", "--tail", "--volumes", "--wait"),
}
PAGE = (DOCS / "OPERATIONS.md").read_text()


async def test_every_series_is_explained_and_no_other() -> None:
    hub = Hub(Limits())

    def described(_robot: Any) -> dict[str, Any]:
        return {}

    store = RedisStore("redis://nowhere", hub, Dispatcher.now, described)
    dispatcher = Dispatcher(hub, store, FanOut(None))
    mirror = SimpleNamespace(written=Counter(), breaker=Breaker())
    way = RedisPastWriter("redis://nowhere", 1 << 20)
    kept, held = MemoryPast(1 << 20), HeldRequests()
    archive = SimpleNamespace(measure=lambda: ArchiveFigures(None, 0, 0, 0, 0, 0, 0, 1, 2))
    figures = RelayCollector([dispatcher], mirror, past=kept, way=way, held=held, archive=archive)
    joined = JoinedCollector(figures, Path("/nowhere"), 2, list, int)
    there = {family.name + ("_total" if family.type == "counter" else "") for family in joined.collect()}
    assert {f"posecast_{name}" for name in ("viewers", "ceiling_hz")} <= SUMMED | LEAST
    assert {family.name for family in figures.collect()} >= SUMMED | LEAST
    rows = re.findall(r"^\| `(posecast_\w+)", PAGE, re.MULTILINE)
    assert sorted(rows) == sorted(there)
    named = re.findall(r"posecast_[a-z_]+(?![a-z_:])", PAGE)  # with a colon behind it, it is a volume
    networks = {"posecast_web"}  # of Docker
    assert {name.removesuffix("_bucket") for name in named} <= there | networks


def test_every_flag_is_one() -> None:
    known = (
        {flag.option for flag in FLAGS}
        | {"--help"}
        | ROBOTS_FLAGS
        | PAST_FLAGS
        | REDIS_FLAGS
        | COMPOSE_FLAGS
        | EDGE_FLAGS
    )
    assert set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", PAGE)) <= known


def test_links_lead_somewhere() -> None:
    for link in re.findall(r"\]\(([^)]+)\)", PAGE):
        file, _, head = link.partition("#")
        assert file == "" or (DOCS / file).exists(), link
        text = (DOCS / file).read_text() if file else PAGE
        titles = [title.lower() for title in re.findall(r"^#+ (.*)$", text, re.MULTILINE)]
        heads = {re.sub(r"[^a-z ]", "", title).replace(" ", "-") for title in titles}
        assert head == "" or head in heads, link


def test_the_commands_for_the_file_of_robots_do_what_they_say(tmp_path: Path) -> None:
    path = tmp_path / "robots.toml"
    environ = os.environ | {"POSECAST_ROBOTS": str(path), "EDITOR": "true"}
    section = PAGE.partition("### The file of robots\n")[2].partition("\n#")[0]
    commands = re.findall(r"^    posecast-relay (robots .+)$", section, re.MULTILINE)
    assert [command.split()[1] for command in commands] == ["set", "edit", "check"]
    at, terminal = pty.openpty()
    for command in ("robots add hubo", *commands):
        program = [sys.executable, "-m", "posecast_relay.cli", *shlex.split(command)]
        done = subprocess.run(
            program, stdin=terminal, env=environ, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
    os.close(at)
    os.close(terminal)
    assert read_robots(path).enrolled["hubo"].rules == {
        Audience.ANYONE: Rule(delay_s=10.0),
        Audience.LINK: Rule(past_s=7200.0),
    }
