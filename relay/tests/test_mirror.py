"""What the mirror writes: by plain calls, then against a double of the database, not Google's."""

from __future__ import annotations

import asyncio
import json
import re
from base64 import b64decode
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from posecast_relay.mirror.changes import Mirror, NodeChange, VisibleRobot, Written
from posecast_relay.mirror.firebase import BATCH_BYTES, split_batches
from posecast_testing import until
from posecast_wire import Decoder

from tests.rtdb_double import Double

from .sim import UNIX_S, Edge, World, schema
from .stage import Relay, Watcher


class Reader:
    """A node as a page reads it: KEY and frame must decode together, whatever was left out before."""

    def __init__(self) -> None:
        self.node: dict[str, Any] = {}
        self.seqs: list[int] = []

    def take(self, node: dict[str, Any] | None) -> None:
        """A write."""
        self.node = {} if node is None else {k: v for k, v in (self.node | node).items() if v is not None}
        if "frame" in self.node:
            decoder = Decoder()
            decoder.add_schema(b64decode(self.node["schema"]).decode())
            for name in ("key", "frame"):
                if name in self.node:
                    frame = decoder.decode(b64decode(self.node[name]))
            self.seqs.append(frame.seq)


class Mirrored:
    """A world with a mirror of its robot `r`."""

    def __init__(self) -> None:
        self.world = World()
        self.edge = self.world.on_air(key_every_s=1.0)
        self.mirror = Mirror()
        self.reader = Reader()
        self.hz = 60.0

    def shown(self) -> dict[str, VisibleRobot]:
        """As the policy shows it to anyone."""
        robot = self.world.hub.robots["r"]
        room = robot.rooms["public"]
        return {"r": VisibleRobot(room.stream, robot.compute_status(room, self.world.now), self.hz)}

    def look(self, shown: dict[str, VisibleRobot] | None = None, works: bool = True) -> dict[str, NodeChange]:
        """One cycle."""
        found = self.shown() if shown is None else shown
        changes = self.mirror.find_changes(found, self.world.now, UNIX_S + self.world.now)
        if not works:
            self.mirror.record_lost(changes)
            return changes
        self.mirror.record_written(changes)
        if "r" in changes:
            self.reader.take(changes["r"].node)
        return changes


def test_every_write_can_be_read_by_itself_and_the_newest_wins() -> None:
    at = Mirrored()
    for turn in range(30):
        at.world.run(at.edge, 0.5)
        at.look(works=turn % 4 != 3)
    assert at.reader.seqs == sorted(set(at.reader.seqs))
    assert at.reader.seqs[-1] > 400
    assert at.reader.node["status"]["robot"] == "online"
    assert at.reader.node["status"]["seq"] == at.reader.seqs[-1]


def test_only_what_has_changed_is_written() -> None:
    at = Mirrored()
    first = at.look()["r"].node
    assert first is not None
    assert set(first) == {"schema", "key", "frame", "status"}
    assert at.look() == {}
    at.world.run(at.edge, 0.5)
    second = at.look()["r"].node
    assert second is not None
    assert "schema" not in second
    assert len(json.dumps(second)) < 400


def test_a_silent_robot_is_told_of_once_a_second_and_an_unchanged_word_no_oftener() -> None:
    at = Mirrored()
    at.look()
    told = []
    for _ in range(20):
        at.world.pass_time(0.5)
        told += [change.node for change in at.look().values()]
    assert 9 <= len(told) <= 11
    assert all(node is not None and set(node) == {"status"} for node in told[1:])
    assert at.reader.node["status"]["robot"] == "silent"
    assert at.reader.node["status"]["age_ms"] >= 9000
    ats = [node["status"]["at"] for node in told if node]  # type: ignore[index]
    assert len(set(ats)) == len(ats)


def test_a_rate_of_the_policy_is_kept() -> None:
    at = Mirrored()
    at.hz = 0.5
    frames = 0
    for _ in range(40):
        at.world.run(at.edge, 0.5)
        frames += sum("frame" in (change.node or {}) for change in at.look().values())
    assert 9 <= frames <= 11


def test_what_is_hidden_is_deleted_and_what_was_found_and_is_not_shown_as_well() -> None:
    at = Mirrored()
    at.mirror.record_existing(["gone"])
    assert at.look()["gone"].node is None
    at.look({}, works=False)
    assert at.look({})["r"].node is None  # until it has worked
    assert at.look({}) == {}
    again = at.look()["r"].node
    assert again is not None
    assert "schema" in again


def test_another_schema_replaces_all() -> None:
    at = Mirrored()
    at.look()
    other = Edge(0xF, schema(("A", "B", "C")), began_s=at.world.now)
    at.world.pass_time(1.0)
    at.world.publish(other)
    at.world.answer(other)
    at.look()
    assert at.reader.seqs[-1] == other.seq


def test_a_request_has_a_bound_and_no_robot_is_torn_apart() -> None:
    node = {"schema": "x" * 300_000, "frame": "y"}
    changes = {f"r{i}": NodeChange(dict(node), Written()) for i in range(10)} | {
        "gone": NodeChange(None, Written())
    }
    made = list(split_batches(changes))
    assert sum(len(batch) for batch, _ in made) == 11
    assert max(len(body) for _, body in made) < BATCH_BYTES + 400_000
    assert json.loads(made[-1][1])["gone"] is None
    assert list(split_batches({})) == []


# ---- against the double ------------------------------------------------------------


@pytest.fixture
def double() -> Iterator[Double]:
    """On a free port."""
    made = Double()
    yield made
    made.stop()


def seq_of(double: Double) -> int:
    node = double.node()
    return -1 if node is None or node["status"]["seq"] is None else int(node["status"]["seq"])


def test_anyone_reads_it_and_only_the_relay_writes_it(double: Double) -> None:
    owner = {"authorization": "Bearer owner"}
    for path, status in (("posecast/r", 200), ("posecast", 401), ("", 401), ("elsewhere", 401)):
        assert httpx.get(f"{double.url}/{path}.json", trust_env=False).status_code == status, path
    for path in ("posecast/r", "posecast/r/frame", "posecast", ""):
        for method in ("PUT", "PATCH", "DELETE"):
            url = f"{double.url}/{path}.json"
            refused = httpx.request(method, url, content=b'{"frame": "x"}', trust_env=False)
            assert refused.status_code == 401, (method, path)
    answer = httpx.put(f"{double.url}/posecast/r.json", json={"frame": "x"}, headers=owner, trust_env=False)
    assert answer.status_code == 200
    assert double.node() == {"frame": "x"}


def test_the_policy_holds_in_the_mirror_and_old_nodes_go(
    tmp_path: Path, relays: Callable[..., Relay], edges: Callable[..., Any], double: Double
) -> None:
    owner = {"authorization": "Bearer owner"}
    url = f"{double.url}/posecast/left.json"  # by an earlier life; it is private by now
    httpx.put(url, json={"frame": "secret"}, headers=owner, trust_env=False)
    file = tmp_path / "robots.toml"

    def rules(text: str) -> None:
        new = file.with_suffix(".new")
        new.write_text(text)
        new.chmod(0o600)
        new.replace(file)

    few = "[robots.few.anyone]\nviewers = 3\n"
    rules("[robots.r.anyone]\n[robots.late.anyone]\ndelay_s = 2\n[robots.lab.signed-in]\n" + few)
    relay = relays("--robots", str(file), "--firebase-database", double.url)
    made = {name: edges(relay.zenoh, robot=name) for name in ("r", "late", "lab", "few")}
    until("r is there", lambda: seq_of(double) > 5)
    late = until("late is there", lambda: (double.node("late") or {}).get("frame") and double.node("late"))
    assert late["status"]["seq"] <= made["late"].seq - 40
    for hidden in ("lab", "few", "left"):
        assert double.node(hidden) is None, hidden
    assert double.says()["at_once"] <= 2  # one of them is `/.double`'s reader

    for change in ("", "[robots.r.anyone]\nblackout = true\n"):
        rules("[robots.other.anyone]\n" + change)
        until("r is gone", lambda: double.node() is None)
        rules("[robots.r.anyone]\n")
        until("r is back", lambda: double.node() is not None)
    made["r"].close()
    until("offline", lambda: (double.node() or {})["status"]["robot"] == "offline")


@pytest.mark.parametrize(
    "fault", [{"answer": 503}, pytest.param({"hang": True}, marks=pytest.mark.full)], ids=["503", "hangs"]
)
async def test_a_database_that_is_away_disturbs_no_viewer(
    relays: Callable[..., Relay], edges: Callable[..., Any], double: Double, fault: dict[str, Any]
) -> None:
    relay = relays("--firebase-database", double.url, "--metrics-port", "0", "--log-level", "info")
    edge = edges(relay.zenoh)
    await asyncio.to_thread(until, "it is there", lambda: seq_of(double) > 5)
    port = re.search(r"metrics on http://127\.0\.0\.1:(\d+)", relay.errors())
    assert port is not None

    def figure(name: str) -> float:
        text = httpx.get(f"http://127.0.0.1:{port[1]}/metrics", trust_env=False).text
        return float(next(line for line in text.splitlines() if line.startswith(name)).rsplit(" ", 1)[1])

    def is_open() -> bool:
        return figure("posecast_mirror_breaker_open") == 1

    async with Watcher(relay.url(query="?hz=30")) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 10)
        double.becomes(**fault)
        began = len(viewer.frames)
        await asyncio.to_thread(until, "the breaker opens", is_open, 30.0)
        await viewer.until("a hundred frames", lambda v: len(v.frames) > began + 100)
        double.becomes()
        await asyncio.to_thread(until, "written again", lambda: seq_of(double) > edge.seq - 60, 30.0)
        await asyncio.to_thread(until, "the breaker closes", lambda: not is_open())
        seqs = [frame.seq for _, frame in viewer.frames]
    assert seqs == sorted(set(seqs))
    assert figure("posecast_skipped_frames_total") == 0
    assert figure('posecast_mirror_requests_total{result="failed"}') >= 3
    assert figure('posecast_mirror_requests_total{result="sent"}') >= 2
    said = relay.errors()
    assert said.count("writing to the database failed") == 1
    assert ("HTTP 503" in said) == ("answer" in fault)
    assert said.count("the database answers again") == 1


@pytest.mark.full
def test_it_ends_at_once_while_the_database_hangs(relays: Callable[..., Relay], double: Double) -> None:
    double.becomes(hang=True)
    relay = relays("--firebase-database", double.url)
    until("it is asked", lambda: double.says()["requests"].get("GET", 0) >= 1)
    assert relay.stop() == 0
    assert "connections are still open" not in relay.errors()
