"""`past delete` beside real processes: a relay that records, a gateway, Redis, a store in a folder."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx
import pytest
from posecast_relay.archive.names import ArchivedName, name_segment, read_segment_key
from posecast_relay.past.segment import KeptSegment
from posecast_testing import until

from .command import run_command
from .past_doors import make_kept
from .redis_server import Redis
from .stage import Model, Relay, ZenohEdge

OBEYED_S = 10.0  # as is promised
HOUR_MS, MINUTE_MS = 3_600_000, 60_000
ROBOTS = """
[robots.r]
keep = "30d"
[robots.r.anyone]
view = "public"
past = "30d"
"""


def run_past(*argv: str, **environ: str) -> subprocess.CompletedProcess[str]:
    """`posecast-relay past …`, to its end."""
    return run_command("past", *argv, stdin=b"", **environ)


def ask(relay: Relay, path: str = "") -> httpx.Response:
    """A request below the past of `r`."""
    return httpx.get(f"http://{relay.address}/api/v1/robots/r/past{path}", timeout=20)


def write_time(unix_ms: int) -> str:
    """As the command takes it."""
    return datetime.fromtimestamp(unix_ms / 1000, UTC).isoformat(timespec="milliseconds")


def list_page(relay: Relay, page_ms: int) -> list[dict[str, Any]]:
    """The index of ten minutes."""
    name = datetime.fromtimestamp(page_ms // 1000, UTC).strftime("%Y-%m-%dT%H:%MZ")
    found: list[dict[str, Any]] = ask(relay, f"/public/{name}").json()["segments"]
    return found


def list_span(relay: Relay, from_ms: int, to_ms: int) -> list[dict[str, Any]]:
    """What a process tells of a span."""
    pages = range(from_ms // 600_000 * 600_000, to_ms, 600_000)
    entries = [entry for page in pages for entry in list_page(relay, page)]
    return [entry for entry in entries if entry["from_ms"] < to_ms and entry["to_ms"] > from_ms]


def put_segment(store: Path, segment: KeptSegment) -> Path:
    """As a relay would, some time ago."""
    path = store / name_segment(segment).key
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(segment.data)
    schema = store / "r" / "schemas" / f"{segment.schema.hex() if segment.schema else ''}.json"
    schema.parent.mkdir(parents=True, exist_ok=True)
    schema.write_text(segment.schema_text or "")
    return path


def list_names(store: Path) -> list[ArchivedName]:
    """The segments in a store, of which folders may be vanishing."""
    files = (Path(folder, file) for folder, _, found in os.walk(store) for file in found)
    keys = (path.relative_to(store).as_posix() for path in files)
    return [name for key in keys if (name := read_segment_key(key)) is not None]


@pytest.fixture
def store(tmp_path: Path) -> Path:
    """A store with a segment for each minute of the last three hours."""
    folder = tmp_path / "store"
    now_ms = time.time_ns() // 1_000_000 // MINUTE_MS * MINUTE_MS
    for index in range(180):
        put_segment(folder, make_kept(index, now_ms - 3 * HOUR_MS + index * MINUTE_MS))
    robots = tmp_path / "robots.toml"
    robots.write_text(ROBOTS)
    robots.chmod(0o600)
    return folder


def test_an_hour_is_seen_to_leave_store_relay_and_gateway_and_comes_back_nowhere(
    tmp_path: Path,
    store: Path,
    relays: Callable[..., Relay],
    edges: Callable[..., ZenohEdge],
    redis_server: Redis,
) -> None:
    kept = ("--past", f"file://{store}", "--robots", str(tmp_path / "robots.toml"))
    shared = (*kept, "--store", redis_server.url)
    relay = relays(*shared)
    gateway = relays("--role", "gateway", *shared)
    model = Model({"robot.urdf": (b"<robot/>", "application/xml")})
    edge = edges(relay.zenoh, model=model)
    edge.force_key = True
    before = list_names(store)
    first_ms = min(name.from_ms for name in before)
    from_ms, to_ms = first_ms + HOUR_MS, first_ms + 2 * HOUR_MS
    both = (relay, gateway)

    def is_recorded() -> bool:
        edge.force_key = True
        return len(list_names(store)) > len(before) and all(list_span(each, from_ms, to_ms) for each in both)

    until("what is recorded is in the store", is_recorded, 30.0)
    until("its model is, too", (store / "r/models" / model.digest / "manifest.json").is_file, 30.0)
    said = run_past("list", "--past", f"file://{store}", "--robot", "r")
    assert said.stdout.splitlines()[1].split()[:2] == ["r", "public"], said
    span = ("--from", write_time(from_ms), "--to", write_time(to_ms))
    said = run_past("delete", "--robot", "r", *span, "--yes", "--past", f"file://{store}")
    assert said.returncode == 0, said
    found = re.match(r"deleted: (\d+) segments, ", said.stdout)
    assert found is not None, said
    assert int(found[1]) <= 60, "the relay may have obeyed before the command came to them"

    def is_gone() -> bool:
        left = [name for name in list_names(store) if name.from_ms < to_ms and name.to_ms > from_ms]
        return not left and not any(list_span(each, from_ms, to_ms) for each in both)

    until("the hour is gone everywhere", is_gone, OBEYED_S)
    for each in both:
        assert ask(each).json()["deleted"] == [{"from_ms": from_ms, "to_ms": to_ms}]
    stays = [name for name in before if name.to_ms <= from_ms or name.from_ms >= to_ms]
    assert len(stays) == 120
    assert set(stays) <= set(list_names(store))
    for each in both:
        shown = {entry["index"] for entry in list_span(each, first_ms, to_ms + HOUR_MS)}
        assert {name.name.index for name in stays} <= shown
    # now all of it: what is in memory and in Redis, and what is being recorded
    seen_ms = time.time_ns() // 1_000_000
    said = run_past("delete", "--robot", "r", "--all", "--yes", "--past", f"file://{store}")
    assert said.returncode == 0, said

    def is_empty() -> bool:
        edge.force_key = True
        oldest = [ask(each).json().get("from_ms") for each in both]
        return not [name for name in list_names(store) if name.from_ms < seen_ms] and all(
            at_ms is None or at_ms >= seen_ms for at_ms in oldest
        )

    until("all of before is gone everywhere", is_empty, OBEYED_S)

    def goes_on() -> bool:
        edge.force_key = True
        return bool(list_names(store)) and all(ask(each).json().get("newest") for each in both)

    until("what comes now is kept", goes_on, 30.0)
    schemas = {segment["schema"] for segment in list_span(relay, seen_ms, seen_ms + HOUR_MS)}
    assert schemas
    until(
        "with its schema", lambda: all((store / f"r/schemas/{each}.json").is_file() for each in schemas), 30
    )
    until("and its model", (store / "r/models" / model.digest / "manifest.json").is_file, 30.0)
    # somebody else puts back what was deleted, and the relay is killed: the next one obeys
    relay.stop(signal.SIGKILL)
    late = put_segment(store, make_kept(7, from_ms))
    again = relays(*shared)
    until("a late one is gone", lambda: not late.exists(), 30.0)
    until("it says so", lambda: list_span(again, from_ms, to_ms) == [])


def test_a_command_that_is_killed_is_finished_by_the_next_start(
    tmp_path: Path, store: Path, relays: Callable[..., Relay]
) -> None:
    first_ms = min(name.from_ms for name in list_names(store))
    span = ("--from", write_time(first_ms), "--to", write_time(first_ms + HOUR_MS))
    argv = ["past", "delete", "--robot", "r", *span, "--yes", "--past", f"file://{store}"]
    command = subprocess.Popen([sys.executable, "-m", "posecast_relay.cli", *argv])
    until("it has begun", lambda: len(list_names(store)) < 180, 30.0)
    command.kill()
    command.wait()
    relays("--past", f"file://{store}", "--robots", str(tmp_path / "robots.toml"))
    until("it is done", lambda: len(list_names(store)) == 120, 30.0)
    assert all(name.from_ms >= first_ms + HOUR_MS for name in list_names(store))

    def has_indexes() -> bool:
        try:
            days = [json.loads(day.read_text()) for day in store.rglob("day.json")]
        except FileNotFoundError:  # it is being written
            return False
        return sum(page["count"] for day in days for page in day["pages"]) == 120  # type: ignore[no-any-return]

    until("indexes say the same", has_indexes, 30.0)


def test_by_its_socket_a_relay_without_a_store_is_reached_and_redis_and_its_gateways(
    tmp_path: Path, relays: Callable[..., Relay], edges: Callable[..., ZenohEdge], redis_server: Redis
) -> None:
    path = tmp_path / "relay.sock"
    relay = relays("--store", redis_server.url, "--past-socket", str(path))
    gateway = relays("--role", "gateway", "--store", redis_server.url)
    edge = edges(relay.zenoh)
    assert path.stat().st_mode & 0o777 == 0o600

    def is_recorded() -> bool:
        edge.force_key = True
        return all(ask(each).json().get("newest") for each in (relay, gateway))

    until("both have something", is_recorded, 30.0)
    said = run_past("list", "--past-socket", str(path))
    assert said.stdout.splitlines()[1].split()[:2] == ["r", "public"], said
    asked_ms = time.time_ns() // 1_000_000
    said = run_past("delete", "--robot", "r", "--all", "--yes", POSECAST_PAST_SOCKET=str(path))
    assert said.returncode == 0, said
    assert said.stdout.startswith("deleted from memory: "), said

    def is_gone() -> bool:
        oldest = [ask(each).json().get("from_ms") for each in (relay, gateway)]
        return all(at_ms is None or at_ms >= asked_ms for at_ms in oldest)

    until("both have nothing of before", is_gone, OBEYED_S)
    relay.stop(signal.SIGKILL)
    assert path.exists()
    assert "no relay answers" in run_past("list", "--past-socket", str(path)).stderr
    other = relays("--past-socket", str(path))  # it takes the place of the one that was killed
    until("it answers", lambda: run_past("list", "--past-socket", str(path)).returncode == 0)
    second = relays("--past-socket", str(path))
    until("one line", lambda: "another process listens on it" in second.errors())
    assert second.stop() == 0
    assert path.exists()
    assert other.stop() == 0
    assert not path.exists()
