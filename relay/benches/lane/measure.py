"""One run of the lane's bench: what a crowd saw through each node, and what it cost the origin meanwhile."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass

from relay.benches.lane.origin import OriginRequest, read_requests
from relay.benches.lane.robot import KEY_INTERVAL_S
from relay.benches.lane.stage import JOIN_S, ROBOT, Crowd, LaneStage, Row, crowds, read_cpu_s
from relay.benches.servers import CannotStart, Place

HZ = 30
HELD_S = 8.0  # the relay holds a request for so long
SETTLE_S = JOIN_S + 6.0  # all have joined, and each has got a segment that it waited for
# what lies around the bytes of the socket, as docs/reference/capacity.md reckons
TLS_RECORD_BYTES = 22.0
PACKET_BYTES = 52.0  # IPv4 and TCP with timestamps


@dataclass(frozen=True)
class LanePlan:
    """How much is measured. Seconds of windows are whole KEY intervals: each has as many segments."""

    crowds: tuple[int, ...] = (100, 1000, 5000)
    rounds: int = 3
    window_s: float = 6 * KEY_INTERVAL_S
    pause_s: float = 60.0
    after_s: float = 4 * KEY_INTERVAL_S  # that is watched after a pause, and after a restart
    bytes_s: float = 120.0  # the whole of the set


SHORT = LanePlan((100, 1000), 1, 3 * KEY_INTERVAL_S, 20.0, 3 * KEY_INTERVAL_S, 12.0)


def sum_requests(found: list[OriginRequest]) -> Row:
    """Count what a node asked the origin. `segments`: different ones that it was given."""
    kinds = ("segment", "next", "not-yet", "past", "other")
    row: Row = {kind: sum(each.kind == kind for each in found) for kind in kinds}
    row["segments"] = len({each.path for each in found if each.kind == "segment"})
    row["cpu_ms"] = sum(each.cpu_us for each in found) / 1e3
    return row


def watch_window(
    stage: LaneStage, found: list[Crowd], scenario: str, meanwhile: Callable[[], None]
) -> list[Row]:
    """What each crowd saw, and each node and the origin did, while `meanwhile` ran."""
    for crowd in found:
        crowd.mark("before")
    pids = [stage.relay_pid, *(node.pid for node in stage.nodes)]
    from_s, began, before = time.time(), time.monotonic(), [read_cpu_s(pid) for pid in pids]
    meanwhile()
    wall_s, after = time.monotonic() - began, [read_cpu_s(pid) for pid in pids]
    to_s = time.time()
    spent = dict(zip(pids, (b - a for a, b in zip(before, after, strict=True)), strict=True))
    rows = []
    for crowd in found:
        row = crowd.mark(scenario)
        origin = sum_requests(read_requests(stage.requests, from_s, to_s, crowd.node.origin_host))
        row |= {"scenario": scenario, "cache": crowd.node.name, "origin": origin}
        row["cpu_ms"] = spent[stage.relay_pid] / wall_s * KEY_INTERVAL_S * 1e3  # a segment
        row["cache_share"] = spent[crowd.node.pid] / wall_s
        rows.append(row | compute_bytes(row))
    return rows


def compute_bytes(row: Row) -> Row:
    """To one viewer each second, everything around it included: TLS records, TCP and IP of each packet."""
    around = row["records"] * TLS_RECORD_BYTES + row["packets"] * PACKET_BYTES
    down = row["heads"] + row["bodies"] + around
    return {"bytes_s": down / row["viewers"] / row["wall_s"] if row["wall_s"] else 0.0}


def measure_idle(stage: LaneStage, window_s: float) -> float:
    """CPU of the origin in a KEY interval without viewers, ms."""
    before, began = read_cpu_s(stage.relay_pid), time.monotonic()
    time.sleep(window_s)
    return (read_cpu_s(stage.relay_pid) - before) / (time.monotonic() - began) * KEY_INTERVAL_S * 1e3


def measure_steady(stage: LaneStage, place: Place, viewers: int, window_s: float) -> list[Row]:
    """So many through each node, while nothing happens."""
    with crowds(place, stage.nodes, viewers) as found:
        time.sleep(SETTLE_S)
        return watch_window(stage, found, "steady", lambda: time.sleep(window_s))


def measure_trouble(stage: LaneStage, place: Place, viewers: int, plan: LanePlan) -> list[Row]:
    """The robot pauses and goes on; then it ends and comes back as another run."""

    def pause() -> None:
        stage.robot.pause()
        time.sleep(plan.pause_s)
        stage.robot.go_on()
        time.sleep(plan.after_s)

    def restart() -> None:
        time.sleep(KEY_INTERVAL_S)
        stage.robot.restart()
        time.sleep(plan.after_s)

    with crowds(place, stage.nodes, viewers) as found:
        time.sleep(SETTLE_S)
        paused = [row | {"pause_s": plan.pause_s} for row in watch_window(stage, found, "pause", pause)]
        return [*paused, *watch_window(stage, found, "restart", restart)]


def measure_bytes(stage: LaneStage, place: Place, seconds: float) -> list[Row]:
    """Few viewers of each node, and as many of WebSockets, side by side: the same frames for all.

    A window has a part of a segment more or less than another: so bytes are those of a frame, times HZ.
    """
    viewers = 20
    command = [str(place.binaries["viewers"]), "--port", str(stage.relay_port), "--stamps", str(place.stamps)]
    command += ["--path", f"/api/v1/robots/{ROBOT}/live?hz=30", "--viewers", str(viewers)]
    command += ["--settle", "0", "--seconds", str(seconds)]
    told: list[str] = []

    def watch() -> None:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=seconds + 60)
        told.append(done.stdout)

    with crowds(place, stage.nodes, viewers) as found:
        time.sleep(SETTLE_S)
        rows = watch_window(stage, found, "bytes", watch)
    if not told[0]:
        raise CannotStart("the WebSocket viewers said nothing")
    live: Row = json.loads(told[0])
    live |= {"scenario": "bytes", "cache": "WebSocket", "frames": live["messages"]}
    # a status rides in the packet of a frame, and is among what was received
    around = live["messages"] * (TLS_RECORD_BYTES + PACKET_BYTES)
    live["parts_s"] = spread_bytes(live, live["bytes"], live["received"] - live["bytes"], around)
    for row in rows:
        around = row["records"] * TLS_RECORD_BYTES + row["packets"] * PACKET_BYTES
        beside = row["heads"] + row["bodies"] - row["segment_bodies"]
        row["parts_s"] = spread_bytes(row, row["segment_bodies"], beside, around)
    return [row | {"bytes_s": sum(row["parts_s"])} for row in (live, *rows)]


def spread_bytes(row: Row, *parts: float) -> list[float]:
    """Of all viewers' bytes those of one in a second, at HZ frames."""
    return [part / row["frames"] * HZ for part in parts]
