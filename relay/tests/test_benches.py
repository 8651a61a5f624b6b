"""The benches: viewers in C count what came, the lane's origin what was asked, its simulation adds up."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import struct
import subprocess
import sys
import threading
import time
import urllib.request
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from posecast_wire import Encoder, Schema, build_schema_text
from posecast_wire.segment import FrameRecord, Segment, SegmentStart, encode_segment
from websockets import Subprotocol
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

from relay.benches.lane.caches import start_nginx
from relay.benches.lane.origin import CountedApp, OriginRequest, TimedCall, name_kind, read_requests
from relay.benches.lane.run import MEASURED
from relay.benches.lane.simulation import HOLD_S, KEY_INTERVAL_S, OriginTally, make_timeline, simulate
from relay.benches.lane.table import find_goals, make_goals, make_steady, requests_a_segment
from relay.benches.servers import Place
from tools.bars import PAGE
from tools.pages import fill

ROOT = Path(__file__).resolve().parents[2]
TAKE, NEXT_TAKE = 0xABC, 0xDEF
FIELDS = [{"name": "pos", "labels": "joint", "unit": "rad", "scale": 0.001}]
SCHEMA = Schema.parse(build_schema_text("bench", {"joint": ["A"]}, FIELDS))

# ---- the viewers in C ----------------------------------------------------------------


@pytest.fixture(scope="module")
def programs() -> dict[str, str]:
    if shutil.which("cc") is None:
        pytest.skip("no C compiler (cc) here")
    build = [sys.executable, "-m", "relay.benches.build"]
    said = subprocess.run(build, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60).stdout
    return dict(line.split(" ", 1) for line in said.splitlines())


@pytest.fixture
def lane_viewers(programs: dict[str, str]) -> str:
    return programs["viewers"]


def make_segment(take: int, index: int, first_seq: int, run: int = 7) -> bytes:
    """A segment of 100 ms that has just ended."""
    encoder, from_ms = Encoder(SCHEMA), round(time.time() * 1000) - 100
    frames = (
        FrameRecord(0, 0, seq, encoder.encode([seq], seq, seq / 30, seq / 30))
        for seq in range(first_seq, first_seq + 3)
    )
    start = SegmentStart("bench", "public", take, index, run, from_ms, "ab" * 32)
    return encode_segment(Segment(start, from_ms + 100, tuple(frames)))


class LaneStandIn(BaseHTTPRequestHandler):
    """Answers as a relay would: each answer of `script` once, and "not yet" ever after."""

    protocol_version = "HTTP/1.1"
    script: dict[str, list[tuple[int, bytes]]]
    asked: Counter[str]

    def do_GET(self) -> None:
        type(self).asked[self.path] += 1
        left = self.script.get(self.path, [])
        status, body = left[0] if left else (204, b"")
        if len(left) > 1:
            left.pop(0)
        self.send_response(status)
        self.send_header("content-length", f"{len(body)}")
        self.send_header("retry-ms", "1000")
        self.send_header("cache-control", "public, max-age=1")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: Any) -> None:
        pass


@contextmanager
def stand_in(script: dict[str, list[tuple[int, bytes]]]) -> Iterator[tuple[str, Counter[str]]]:
    past = "/api/v1/robots/bench/past"
    script = {past + path: answers for path, answers in script.items()}
    handler = type("Handler", (LaneStandIn,), {"script": script, "asked": Counter()})
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"{server.server_address[1]}", handler.asked  # type: ignore[attr-defined]
    finally:
        server.shutdown()
        server.server_close()


def watch_lane(binary: str, port: str, viewers: int) -> list[str]:
    """The command of viewers that all come at once."""
    what = {"mode": "lane", "port": port, "robot": "bench", "viewers": f"{viewers}", "join": "0"}
    return [binary, *(part for name, value in what.items() for part in (f"--{name}", value))]


def watch(binary: str, port: str, until: Counter[str], path: str, viewers: int = 3) -> dict[str, Any]:
    """What viewers saw until so many have asked for `path` at least once each."""
    command = watch_lane(binary, port, viewers)
    pipe = subprocess.PIPE
    with subprocess.Popen([*command, "--seconds", "60"], stdin=pipe, stdout=pipe, text=True) as child:
        end_s = time.monotonic() + 50
        while until[f"/api/v1/robots/bench/past{path}"] < viewers and time.monotonic() < end_s:
            time.sleep(0.02)
        said, _ = child.communicate("all\n", timeout=10)
    assert child.returncode == 0
    row: dict[str, Any] = json.loads(said.splitlines()[0])
    return row


def newest(index: int) -> bytes:
    return json.dumps({"newest": {"take": f"{TAKE:016x}", "index": index}}, separators=(",", ":")).encode()


def named(take: int, index: int) -> bytes:
    return json.dumps({"next": {"take": f"{take:016x}", "index": index}}, separators=(",", ":")).encode()


BAD = ("gaps", "missed", "repeats", "unreadable", "lost", "silent")


def test_viewers_read_segment_after_segment_and_into_the_next_take(lane_viewers: str) -> None:
    segments = {
        f"/public/{TAKE:016x}/4": make_segment(TAKE, 4, 1),
        f"/public/{TAKE:016x}/5": make_segment(TAKE, 5, 4),
        f"/public/{NEXT_TAKE:016x}/0": make_segment(NEXT_TAKE, 0, 1, run=8),
    }
    script = {path: [(200, body)] for path, body in segments.items()}
    script |= {"?view=public": [(200, newest(4))], f"/public/{TAKE:016x}/6": [(200, named(NEXT_TAKE, 0))]}
    with stand_in(script) as (port, asked):
        row = watch(lane_viewers, port, asked, f"/public/{NEXT_TAKE:016x}/1")
    assert {name: row[name] for name in BAD} == dict.fromkeys(BAD, 0), row
    assert (row["segments"], row["least"], row["first"], row["nexts"]) == (9, 3, 3, 3)
    assert (row["frames"], row["refused"], row["summaries"]) == (27, {}, 6)
    assert row["segment_bodies"] == 3 * sum(map(len, segments.values()))
    assert row["age_ms"]["max"] > 0


def test_viewers_that_begin_at_an_old_end_of_the_past_come_to_the_new_one(lane_viewers: str) -> None:
    """A cache tells an old end twice, then the real one: viewers go on there and ask for none between."""
    script = {f"/public/{TAKE:016x}/{i}": [(200, make_segment(TAKE, i, 1 + 3 * i))] for i in range(15)}
    script["?view=public"] = [(200, newest(0)), (200, newest(0)), (200, newest(14))]
    with stand_in(script) as (port, asked):
        row = watch(lane_viewers, port, asked, f"/public/{TAKE:016x}/15", viewers=1)
    past = "/api/v1/robots/bench/past"
    read = [i for i in range(15) if asked[f"{past}/public/{TAKE:016x}/{i}"]]
    assert read == [0, 1, 2, 3, 4, 5, 14], row
    assert (asked[f"{past}?view=public"], row["summaries"], row["repeats"], row["gaps"]) == (3, 3, 0, 1)


def test_what_is_missing_comes_twice_or_is_refused_is_counted(lane_viewers: str) -> None:
    script = {
        "?view=public": [(200, newest(0))],
        f"/public/{TAKE:016x}/0": [(200, make_segment(TAKE, 0, 1))],
        f"/public/{TAKE:016x}/1": [(200, make_segment(TAKE, 1, 9))],  # five are missing
        f"/public/{TAKE:016x}/2": [(200, make_segment(TAKE, 2, 10))],  # two again
        f"/public/{TAKE:016x}/3": [(503, b"busy")],
    }
    with stand_in(script) as (port, asked):
        row = watch(lane_viewers, port, asked, f"/public/{TAKE:016x}/3", viewers=1)
        assert asked[f"/api/v1/robots/bench/past/public/{TAKE:016x}/3"] >= 1
    assert (row["gaps"], row["missed"], row["repeats"]) == (1, 5, 1)


def test_bytes_that_are_no_segment_are_unreadable(lane_viewers: str) -> None:
    script = {
        "?view=public": [(200, newest(0))],
        f"/public/{TAKE:016x}/0": [(200, b"\x89PCS\x01" + b"\xff" * 600)],
    }
    with stand_in(script) as (port, asked):
        command = watch_lane(lane_viewers, port, 1)
        pipe = subprocess.PIPE
        with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as child:
            while asked["/api/v1/robots/bench/past?view=public"] < 2:  # it begins anew
                time.sleep(0.02)
            said, _ = child.communicate("", timeout=10)
    row = json.loads(said)
    assert (row["segments"], row["unreadable"] >= 1) == (0, True)


def test_viewers_look_back_at_an_index_its_poses_and_two_segments(lane_viewers: str) -> None:
    at_ms, name = 1_800_000_000_000, {"take": f"{TAKE:016x}", "index": 4}
    summary = {"from_ms": at_ms, "to_ms": at_ms, "newest": name}
    index = {"segments": [{"take": f"{TAKE:016x}", "index": n} for n in range(2)]}
    page = "/public/2027-01-15T08:00Z"
    script = {
        "?view=public": [
            (200, json.dumps(said, separators=(",", ":")).encode()) for said in ({"newest": None}, summary)
        ],
        "/public/2027-01-15": [(200, b"{}")],
        page: [(200, json.dumps(index, separators=(",", ":")).encode())],
        f"{page}/keys": [(503, b"")],
        f"/public/{TAKE:016x}/1": [(200, b"x" * 500)],
    }
    command = [
        lane_viewers,
        "--mode",
        "past",
        "--robot",
        "bench",
        "--viewers",
        "1",
        "--join",
        "0",
        "--every",
        "1",
    ]
    with stand_in(script) as (port, asked):
        pipe = subprocess.PIPE
        with subprocess.Popen([*command, "--port", port], stdin=pipe, stdout=pipe, text=True) as child:
            assert child.stdout is not None
            assert child.stdout.readline() == "READY\n"
            while not asked[f"/api/v1/robots/bench/past/public/{TAKE:016x}/0"]:
                time.sleep(0.02)
            said, _ = child.communicate("", timeout=10)
    row = json.loads(said)
    assert asked.keys() == {
        f"/api/v1/robots/bench/past{path}" for path in (*script, f"/public/{TAKE:016x}/0")
    }
    assert row["refused"]["503"] >= 1
    assert row["bodies"] >= 1000
    assert row["waited_ms"]["max"] > 0


@pytest.mark.parametrize(
    "wrong", [("--viewers", "20001"), ("--seconds", "0"), ("--port", "0"), ("--odd", "1")]
)
def test_options_have_bounds(lane_viewers: str, wrong: tuple[str, str]) -> None:
    command = [lane_viewers, "--mode", "lane", "--port", "1", "--robot", "bench", "--viewers", "1", *wrong]
    assert subprocess.run(command, capture_output=True, timeout=10, check=False).returncode == 2


# ---- a node -----------------------------------------------------------------------------


def test_nobody_begins_where_the_past_ended_long_ago(tmp_path: Path) -> None:
    """What nginx has kept of a moment ago is no beginning, and a crowd asks for the new one once."""
    if shutil.which("nginx", path=f"{os.environ['PATH']}:/usr/sbin") is None:
        pytest.skip("no nginx here")
    script = {"?view=public": [(200, newest(1)), (200, newest(7))]}
    core = sorted(os.sched_getaffinity(0))[-1]
    with (
        stand_in(script) as (port, asked),
        start_nginx(f"127.0.0.1:{port}", Place(core, core, {}, tmp_path)) as node,
    ):
        address = f"http://127.0.0.1:{node.port}/api/v1/robots/bench/past?view=public"

        def ask(_: int) -> int:
            with urllib.request.urlopen(address, timeout=20) as answer:
                return int(json.load(answer)["newest"]["index"])

        assert ask(0) == 1
        began_s = int(time.time())
        while time.time() < began_s + 2:  # until what was said holds no longer
            time.sleep(0.02)
        with ThreadPoolExecutor(16) as crowd:
            assert set(crowd.map(ask, range(32))) == {7}
    assert asked["/api/v1/robots/bench/past?view=public"] <= 1 + 2  # a second may have ended among them


# ---- the origin ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "status", "content_type", "kind"),
    [
        ("/api/v1/robots/a/past", 200, b"application/json", "past"),
        (f"/api/v1/robots/a/past/public/{TAKE:016x}/7", 200, b"application/octet-stream", "segment"),
        (f"/api/v1/robots/a/past/public/{TAKE:016x}/7", 200, b"application/json", "next"),
        (f"/api/v1/robots/a/past/public/{TAKE:016x}/7", 204, b"", "not-yet"),
        (f"/api/v1/robots/a/past/public/{TAKE:016x}/7", 404, b"application/json", "other"),
        ("/api/v1/robots", 200, b"application/json", "other"),
    ],
)
def test_what_an_answer_was(path: str, status: int, content_type: bytes, kind: str) -> None:
    assert name_kind(path, status, content_type) == kind


def test_each_answer_is_a_line_and_its_cpu_time_is_its_own(tmp_path: Path) -> None:
    async def app(_scope: Any, _receive: Any, send: Any) -> None:
        await asyncio.sleep(0.01)  # as held: others work meanwhile
        sum(range(200_000))
        await send({"type": "http.response.start", "status": 204, "headers": []})

    async def burn() -> None:
        end_ns = time.thread_time_ns() + 200_000_000
        while time.thread_time_ns() < end_ns:
            await asyncio.sleep(0)

    async def run() -> None:
        async def send(_message: Any) -> None: ...

        scope = {
            "type": "http",
            "path": f"/api/v1/robots/a/past/public/{TAKE:016x}/7",
            "server": ("127.0.0.2", 1),
        }
        with (tmp_path / "log").open("wb", buffering=0) as log:
            await asyncio.gather(CountedApp(app, log.fileno())(scope, None, send), burn())

    asyncio.run(run())
    (line,) = read_requests(tmp_path / "log", 0.0, time.time() + 1, "127.0.0.2")
    assert (line.kind, line.status) == ("not-yet", 204)
    assert 0 < line.cpu_us < 150_000
    assert read_requests(tmp_path / "log", 0.0, time.time() + 1, "127.0.0.3") == []
    assert OriginRequest.read(line.write()) == line


def test_a_timed_call_can_be_cancelled() -> None:
    async def run() -> str:
        async def wait() -> None:
            try:
                await asyncio.sleep(60)
            except asyncio.CancelledError:
                ended.append("cancelled")
                raise

        ended: list[str] = []
        task = asyncio.ensure_future(_await(TimedCall(wait())))
        await asyncio.sleep(0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        return ended[0]

    async def _await(call: TimedCall) -> None:
        await call

    assert asyncio.run(run()) == "cancelled"


# ---- the tables ------------------------------------------------------------------------


def make_row(viewers: int, cache: str, **more: Any) -> dict[str, Any]:
    origin = {"segment": 6, "next": 0, "not-yet": 0, "past": 0, "other": 0, "segments": 6, "cpu_ms": 3.0}
    row = {
        "scenario": "steady",
        "viewers": viewers,
        "cache": cache,
        "round": 0,
        "cpu_ms": 60.0,
        "idle_ms": 59.0,
    }
    row |= {
        "origin": origin,
        "bytes_s": 3000.0,
        "cache_share": 0.1,
        "wall_s": 24.0,
        "least": 6,
        "refused": {},
    }
    row |= {"age_ms": {"p50": 4000.0, "p95": 4100.0, "max": 4300.0}}
    return row | dict.fromkeys(("gaps", "repeats", "lost", "silent", "unreadable"), 0) | more


def test_goals_are_missed_by_one_request_too_many_and_one_refused_viewer() -> None:
    rows = [make_row(100, "nginx"), make_row(5000, "nginx")]
    assert all(goal.reached for goal in find_goals(rows))
    assert "| 5,000 | nginx | 1.00 |" in make_steady(rows)
    rows[1]["origin"]["segment"] += 1
    rows[1]["refused"] = {"503": 1}
    missed = [goal.name for goal in find_goals(rows) if not goal.reached]
    assert missed == [
        "nginx: origin requests per segment, steady, worst",
        "nginx: refused, lost, duplicated, gaps",
    ]


def test_a_goal_of_both_caches_is_one_line_and_missed_where_one_misses_it() -> None:
    rows = [make_row(100, cache) for cache in ("nginx", "Varnish")]
    assert "| refused, lost, duplicated, gaps | ≤ 0 | nginx **0**, Varnish **0** | reached |" in make_goals(
        find_goals(rows)
    )
    rows[1]["refused"] = {"503": 1}
    table = make_goals(find_goals(rows))
    assert "| refused, lost, duplicated, gaps | ≤ 0 | nginx **0**, Varnish **1** | **missed** |" in table
    assert "| delay of 100 viewers, p95, s | ≤ 4.7 | nginx **4.10**, Varnish **4.10** | reached |" in table


def test_not_yet_counts_while_nothing_pauses_and_not_in_a_pause() -> None:
    row = make_row(100, "nginx")
    row["origin"]["not-yet"] = 3
    assert requests_a_segment(row) == 1.5
    assert requests_a_segment(row | {"scenario": "pause"}) == 1.0


def test_a_block_is_filled_and_a_missing_one_named() -> None:
    page = "a\n<!-- lane-x: written -->\nold\n<!-- /lane-x -->\nb\n"
    assert (
        fill(page, {"lane-x": "new"}, "x.md") == "a\n<!-- lane-x: written -->\n\nnew\n\n<!-- /lane-x -->\nb\n"
    )
    with pytest.raises(ValueError, match="0 blocks called 'lane-y'"):
        fill(page, {"lane-y": "new"}, "x.md")


def test_the_page_says_what_was_measured() -> None:
    measured, page = json.loads(MEASURED.read_text()), PAGE.read_text()
    for bytes_s in (measured["websocket_bytes_s"], *measured["lane_bytes_s"].values()):
        assert f"**{bytes_s:,}**" in page


# ---- the simulation ----------------------------------------------------------------------

NODES = 4


def play(*robots: Any, **more: Any) -> OriginTally:
    return simulate(robots, NODES, 400, join_s=20.0, **more)


def test_each_node_asks_once_for_a_part() -> None:
    tally = play(make_timeline("a", 100.0))
    assert tally.requests_a_part == 1.0
    assert tally.answers["not yet"] == tally.turned_away == 0
    assert tally.held_most <= NODES
    assert tally.parts >= NODES * 15
    ages = [float(age) for each in tally.behind_s for age in each]
    assert min(ages) >= KEY_INTERVAL_S
    assert sorted(ages)[len(ages) * 95 // 100] <= KEY_INTERVAL_S + 0.7


def test_in_a_pause_each_node_is_told_not_yet_once_in_a_hold() -> None:
    tally = play(make_timeline("a", 150.0, pause=(60.0, 60.0)))
    assert tally.requests_a_part == 1.0
    assert 0 < tally.answers["not yet"] <= NODES * 60 / HOLD_S


def test_a_new_run_is_named_once_to_each_node() -> None:
    tally = play(make_timeline("a", 100.0, restart_s=60.5))
    assert (tally.requests_a_part, tally.answers["next"]) == (1.0, NODES)


def test_where_fewer_may_be_held_than_nodes_ask_the_others_come_again() -> None:
    tally = play(make_timeline("a", 100.0), held_max=NODES - 1)
    assert tally.held_most == NODES - 1
    assert tally.turned_away == tally.answers["not yet"] > 0
    assert tally.requests_a_part > 1.0


def test_every_viewer_gets_every_part_from_its_first_on() -> None:
    tally = play(make_timeline("a", 100.0))
    assert sum(map(len, tally.behind_s)) >= 400 * 18


# ---- the bench's C programs compile, find each other, and count what was sent --------


KEY_HEADER = struct.Struct("<BIId")  # wire format 1: tag, schema id, seq, t s


@pytest.fixture
def stamps(tmp_path: Path) -> Path:
    path = tmp_path / "stamps"
    path.write_bytes(bytes(65537 * 8))
    return path


def watch_bare(programs: dict[str, str], stamps: Path, *more: str) -> dict[str, object]:
    """What 20 viewers of a bare server at 50 Hz saw."""
    command = [programs["bare_server"], "--hz", "50", "--stamps", str(stamps)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            port = server.stdout.readline().split()[1]
            viewers = [programs["viewers"], "--port", port, "--stamps", str(stamps), "--viewers", "20"]
            viewers += ["--server-pid", str(server.pid), *more]
            done = subprocess.run(viewers, capture_output=True, text=True, check=True, timeout=60)
        finally:
            server.kill()
    seen: dict[str, object] = json.loads(done.stdout)
    return seen


def test_twenty_viewers_see_every_frame_once_and_in_order(programs: dict[str, str], stamps: Path) -> None:
    seen = watch_bare(programs, stamps, "--seconds", "1", "--settle", "0.2")
    messages = seen["messages"]
    assert isinstance(messages, int)
    assert messages > 0
    assert seen["bytes"] == 200 * messages
    assert seen["keys"] == messages
    assert seen["opened"] == 20
    troubles = ("failed", "duplicates", "reordered", "missed", "orphans", "unreadable", "unstamped", "closed")
    assert {name: seen[name] for name in troubles} == dict.fromkeys(troubles, 0)
    assert isinstance(seen["acks"], int)
    assert isinstance(seen["wall_s"], float)
    # at the first frame, then once a second at most; the settling and one at either end
    assert 20 <= seen["acks"] <= 20 * (seen["wall_s"] + 0.2 + 2)


def test_frozen_viewers_are_not_counted(programs: dict[str, str], stamps: Path) -> None:
    seen = watch_bare(programs, stamps, "--seconds", "1", "--settle", "0.2", "--frozen", "10")
    assert seen["jain"] == pytest.approx(1.0, abs=0.01)
    assert seen["frozen"] == {"count": 10, "gone": 0, "last_gone_s": 0.0, "backlog_s": 0.0}


def test_all_at_once(programs: dict[str, str], stamps: Path) -> None:
    seen = watch_bare(programs, stamps, "--mode", "storm")
    assert (seen["opened"], seen["failed"]) == (20, 0)


def test_viewers_of_another_protocol(programs: dict[str, str], stamps: Path) -> None:
    """They ask for its subprotocol, greet it, and find the frame behind its own bytes."""
    heard: set[tuple[str | None, str | bytes]] = set()

    def news(connection: ServerConnection) -> None:
        heard.add((connection.subprotocol, connection.recv()))
        connection.send(b"welcome")  # shorter than any frame, so none
        with suppress(ConnectionClosed):
            for seq in count(1):
                connection.send(b"MSG " + KEY_HEADER.pack(0x13, 0, seq, 0.0).ljust(50))
                with suppress(TimeoutError):
                    heard.add(("later", connection.recv(timeout=0.02)))

    with serve(news, "127.0.0.1", 0, subprotocols=[Subprotocol("news")], compression=None) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        port = str(server.socket.getsockname()[1])
        command = [programs["viewers"], "--port", port, "--stamps", str(stamps), "--viewers", "3"]
        command += ["--seconds", "0.5", "--settle", "0.1", "--subprotocol", "news", "--greet", "hex:00ff"]
        command += ["--skip", "4", "--acks", "0"]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
        server.shutdown()
    seen = json.loads(done.stdout)
    assert heard == {("news", b"\x00\xff")}
    assert seen["bytes"] == 50 * seen["messages"]
    assert (seen["unreadable"], seen["acks"], seen["opened"]) == (0, 0, 3)
    assert seen["received"] >= seen["messages"] * (50 + 4 + 2)
