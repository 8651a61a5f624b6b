"""What an operator sees: metrics and the log."""

from __future__ import annotations

import asyncio
import json
import logging
import re
from typing import Any

import httpx
import pytest
import websockets
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.http.metrics import RelayCollector
from posecast_relay.kit import BOUNDS_S, Histogram
from posecast_relay.logging import JsonLines
from posecast_relay.runtime.dispatcher import Dispatcher, MemoryStore
from posecast_relay.runtime.fan_out import FanOut
from posecast_testing import free_port, until
from posecast_wire import Close
from prometheus_client.parser import text_string_to_metric_families

from .stage import Watcher

LABELS = {"state", "fate", "result", "code", "flag", "le"}


def figures(port: int) -> dict[str, float]:
    """Every sample, labels and all."""
    text = httpx.get(f"http://127.0.0.1:{port}/metrics").text
    found = {}
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            assert set(sample.labels) <= LABELS
            found[sample.name + "".join(f"|{v}" for v in sample.labels.values())] = sample.value
    return found


def test_a_histogram_counts_by_buckets() -> None:
    times = Histogram()
    for seconds in (0.0005, 0.001, 0.0011, 4.0, 100.0):
        times.add(seconds)
    assert times.counts == [2, 1, *[0] * 9, 1, 1]
    assert len(times.counts) == len(BOUNDS_S) + 1
    assert times.sum_s == pytest.approx(104.0026)


async def test_the_figures_of_a_running_relay(relays: Any, edges: Any) -> None:
    port = free_port()
    relay = relays("--metrics-port", str(port))
    edges(relay.zenoh)
    async with Watcher(relay.url()) as viewer, Watcher(relay.url()) as other:
        await viewer.until("frames", lambda v: len(v.frames) > 30)
        assert other.connection is not None
        await other.connection.send(b"\x00")
        await other.until("its end", lambda v: v.closed is not None)
        httpx.get(f"http://{relay.address}/api/v1/robots/r/live.sse?hz=x")
        async with websockets.connect(relay.url("R*")) as absent:
            await absent.wait_closed()
        found = await asyncio.to_thread(figures, port)
    assert found["posecast_viewers"] == 1
    assert found["posecast_robots|online"] == 1
    assert found["posecast_handshakes_total|accepted"] == 2
    assert found["posecast_handshakes_total|told to go"] == 1
    assert found["posecast_handshakes_total|refused"] == 1
    assert found[f"posecast_endings_total|{int(Close.BINARY)}"] == 1
    assert found[f"posecast_endings_total|{int(Close.ABSENT)}"] == 1
    assert found["posecast_evictions_total"] == 0
    assert found["posecast_delivered_frames_total"] >= 30
    assert found["posecast_skipped_frames_total"] >= 0
    assert found["posecast_ceiling_hz"] == float("inf")
    for name in ("frame_lateness", "fan_out", "loop_lag"):
        count = found[f"posecast_{name}_seconds_count"]
        assert count > 10
        assert found[f"posecast_{name}_seconds_bucket|+Inf"] == count
        assert 0 <= found[f"posecast_{name}_seconds_sum"] < 60


async def test_a_ceiling_for_delayed_viewers_shows_as_well() -> None:
    hubs = Hub(Limits()), Hub(Limits())
    store = MemoryStore()
    collector = RelayCollector([Dispatcher(hub, store, FanOut(None)) for hub in hubs])

    def read() -> float:
        found = {family.name: family for family in collector.collect()}
        return float(found["posecast_ceiling_hz"].samples[0].value)

    assert read() == float("inf")
    for second in range(3):
        hubs[1].load.measure_load(busy=1.0, behind=0, viewers=1, fastest_hz=30.0, now=float(second))
    assert read() == 15.0


async def test_the_log_is_json_lines_and_holds_no_token(relays: Any, edges: Any) -> None:
    relay = relays("--log-level", "debug")
    edges(relay.zenoh)
    with pytest.raises(websockets.InvalidStatus):
        await websockets.connect(relay.url(query="?token=CANARY"))
    async with Watcher(relay.url()) as viewer:
        await viewer.until("frames", lambda v: v.frames)
        assert viewer.connection is not None
        await viewer.connection.send('{"type":"auth","token":"CANARY"}')
        await viewer.connection.send('{"type":"CANARY"}')
        await viewer.until("its end", lambda v: v.closed is not None)
    httpx.get(
        f"http://{relay.address}/api/v1/robots?token=CANARY", headers={"authorization": "Bearer CANARY"}
    )
    httpx.get(f"http://{relay.address}/api/v1/robots/r/live.sse?hz=CANARY")
    await asyncio.to_thread(until, "the log", lambda: "viewer disconnected" in relay.errors())
    assert relay.stop() == 0
    assert "CANARY" not in relay.errors()
    lines = [json.loads(line) for line in relay.errors().splitlines()]
    assert all({"ts", "level", "event"} <= set(line) for line in lines)
    (came,) = [line for line in lines if line["event"] == "viewer connected"]
    assert (came["conn"], came["robot"], came["level"]) == (1, "r", "info")
    (gone,) = [line for line in lines if line["event"] == "viewer disconnected"]
    assert gone | {"ts": ""} == {
        "ts": "", "level": "info", "event": "viewer disconnected", "conn": 1, "robot": "r",
        "code": Close.NOT_ALLOWED, "reason": "type must be rate, ack, auth or ping",
    }  # fmt: skip
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}\+00:00", gone["ts"])


def test_an_exception_is_one_line() -> None:
    try:
        raise ValueError("two\nlines")
    except ValueError as e:
        record = logging.LogRecord("x", logging.ERROR, "f", 1, "it %s", ("broke",), (type(e), e, None))
    line = JsonLines().format(record)
    assert "\n" not in line
    assert re.fullmatch(
        r"it broke: ValueError: two\\u\{a\}lines \(test_observability\.py:\d+\)", json.loads(line)["event"]
    )
    assert "exception" not in json.loads(line)  # its traceback is for level debug
