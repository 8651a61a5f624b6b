"""One run: one server, one crowd of viewers, one row of figures."""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from posecast_testing import Process

from relay.benches.feed import LAG_SAMPLE
from relay.benches.scenarios import RELAYS, Scenario
from relay.benches.servers import ROBOT, CannotStart, Place, Server, hear, serving
from relay.benches.stamps import make_stamps

Row = dict[str, Any]  # what `viewers` prints, and what is derived from it here

POLL_S = 0.5
RUN_LIMIT_S = 150.0


def open_sockets(pid: int) -> int:
    held = 0
    for entry in os.scandir(f"/proc/{pid}/fd"):
        with suppress(FileNotFoundError):  # closed meanwhile
            held += os.readlink(entry.path).startswith("socket:")
    return held


def command(scenario: Scenario, server: Server, place: Place, seconds: float, relay: bool) -> list[str]:
    asked: dict[str, object] = {
        "--port": server.port,
        "--path": server.path,
        "--viewers": scenario.viewers,
        "--stamps": place.stamps,
        "--mode": "storm" if scenario.storm else "steady",
        "--seconds": seconds,
        "--step": scenario.step if relay else 1,
        "--server-pid": server.pid,
        "--server-core": place.server_core,
    }
    if scenario.frozen:
        asked |= {"--frozen": scenario.frozen}
    if scenario.resume_after_s:
        asked |= {"--resume-after": scenario.resume_after_s}
    return [str(place.binaries["viewers"]), *(str(part) for pair in asked.items() for part in pair)]


def watch(child: subprocess.Popen[str], server: Server) -> tuple[str, list[tuple[float, int]]]:
    """What the viewers said, and how many sockets the server held when (monotonic s)."""
    deadline, held = time.monotonic() + RUN_LIMIT_S, list[tuple[float, int]]()
    while True:
        try:
            said, _ = child.communicate(timeout=POLL_S)
            return said, held
        except subprocess.TimeoutExpired:
            if time.monotonic() > deadline:
                child.kill()
                raise CannotStart(f"viewers did not end within {RUN_LIMIT_S:.0f} s") from None
            held.append((time.monotonic(), open_sockets(server.pid)))


def lag_ms(path: Path, began_s: float, ended_s: float) -> Row:
    """Event-loop lateness within the window. One firing after it too: a block is noticed when it is over."""
    fired = LAG_SAMPLE.iter_unpack(path.read_bytes())
    samples = sorted(late for at, late in fired if began_s <= at <= ended_s + 0.5)
    if not samples:
        return {}
    return {
        "p50": samples[len(samples) // 2] * 1e3,
        "p99": samples[int(len(samples) * 0.99)] * 1e3,
        "max": samples[-1] * 1e3,
    }


def derive(row: Row, scenario: Scenario, server: Server, held: list[tuple[float, int]]) -> None:
    cpu, messages = row["server_cpu_s"], row["messages"]
    row["messages_per_cpu_s"] = messages / cpu if cpu > 0 else 0.0
    row["cpu_us"] = cpu * 1e6 / messages if messages else 0.0
    row["server_share"] = cpu / row["wall_s"]
    row["others_share"] = max(0.0, row["core_busy_s"] - cpu) / row["wall_s"]
    row["delivered"] = messages / (row["wall_s"] * scenario.hz * max(1, row["opened"] - scenario.frozen))
    row["missed_share"] = row["missed"] / max(1, messages + row["missed"])
    rss = row["rss_mb"]
    row["rss_mb_per_1000"] = (rss["connected"] - rss["idle"]) * 1000 / max(1, row["opened"])
    row["message_bytes"] = row["bytes"] / messages if messages else 0.0
    if server.lag is not None and server.lag.exists():
        row["lag_ms"] = lag_ms(server.lag, row["window_began_s"], row["window_began_s"] + row["wall_s"])
    if scenario.frozen:
        frozen = row["frozen"]
        frozen["rss_kib_each"] = (rss["end"] - rss["connected"]) * 1e6 / 1024 / scenario.frozen
        began = row["window_began_s"]
        before = [n for at, n in held if at <= began]
        gone = [at for at, n in held if before and at > began and n <= before[-1] - scenario.frozen]
        frozen["fds_gone_s"] = gone[0] - began if gone else None


def play(asked: list[str], server: Server) -> tuple[Row, list[tuple[float, int]]]:
    """The viewers of this command line, on the bench's own core; what they saw, and the server's sockets."""
    child = subprocess.Popen(asked, stdout=subprocess.PIPE, text=True)
    said, held = watch(child, server)
    if not said:
        raise CannotStart(f"its viewers said nothing (exit {child.returncode})")
    row: Row = json.loads(said)
    if not row["messages"]:
        raise CannotStart("its viewers got no frame, see its log in out/bench")
    return row, held


@contextmanager
def looking_back(scenario: Scenario, server: Server, place: Place, seen: Row) -> Iterator[None]:
    """Meanwhile the scenario's lookers look back; what they saw comes into `seen`."""
    if not scenario.lookers:
        yield
        return
    command = [str(place.binaries["viewers"]), "--mode", "past", "--port", str(server.port)]
    command += ["--robot", ROBOT, "--viewers", str(scenario.lookers), "--join", "5"]
    child = Process(place.out, "lookers", *command, stdin=subprocess.PIPE)
    try:
        hear(child, "^READY$")
        yield
        child.process.communicate(timeout=RUN_LIMIT_S)
        seen |= json.loads(child.out.splitlines()[-1])
    finally:
        child.kill()


def measure(kind: str, scenario: Scenario, place: Place, seconds: float) -> Row:
    """CannotStart when the server or the viewers did not run."""
    make_stamps(place.stamps)
    with serving(kind, scenario, place) as server:
        asked = command(scenario, server, place, seconds, kind in RELAYS)
        looked: Row = {}
        with looking_back(scenario, server, place, looked):
            row, held = play(asked, server)
        if looked:
            row["looked_back"] = looked
        row |= {"scenario": scenario.name, "server": kind, "load_average": os.getloadavg()[0]}
        derive(row, scenario, server, held)
    return row
