"""The past through a real Redis, of real processes: some that hear a robot, one is killed, and gateways."""

from __future__ import annotations

import signal
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

import httpx
from posecast_testing import free_port, until
from posecast_wire.segment import decode_segment

from .redis_server import Redis
from .stage import Relay, ZenohEdge
from .test_observability import figures

PAST = ("--past", "memory:")


def ask(relay: Relay, path: str = "") -> httpx.Response:
    """A request below the past of `r`."""
    return httpx.get(f"http://{relay.address}/api/v1/robots/r/past{path}", timeout=20)


def list_entries(relay: Relay) -> list[dict[str, Any]]:
    """The index of all that there is."""
    summary = ask(relay).json()
    if summary.get("from_ms") is None:
        return []
    pages = range(summary["from_ms"] // 600_000, summary["to_ms"] // 600_000 + 1)
    names = [datetime.fromtimestamp(600 * page, UTC).strftime("%Y-%m-%dT%H:%MZ") for page in pages]
    return [entry for name in names for entry in ask(relay, f"/public/{name}").json()["segments"]]


def await_entries(relay: Relay, edge: ZenohEdge, of: Callable[[list[dict[str, Any]]], bool]) -> list[Any]:
    """Wait until an index is such. KEYs come often, so that segments are closed soon."""

    def look() -> list[dict[str, Any]] | None:
        edge.force_key = True
        found = list_entries(relay)
        return found if of(found) else None

    return until("segments at a gateway", look, 15.0)


def overlap(entries: list[dict[str, Any]]) -> bool:
    """Whether two recorders have told of the same moment."""
    return any(
        one["take"] != other["take"] and one["from_ms"] < other["to_ms"] and other["from_ms"] < one["to_ms"]
        for one in entries
        for other in entries
    )


def test_a_gateway_reads_what_an_all_relay_kept(
    relays: Callable[..., Relay], edges: Callable[..., ZenohEdge], redis_server: Redis
) -> None:
    port = free_port()
    relay = relays("--store", redis_server.url, *PAST, "--metrics-port", str(port))
    beside = free_port()
    gateway = relays(
        *("--role", "gateway", "--store", redis_server.url, *PAST, "--metrics-port", str(beside))
    )
    edge = edges(relay.zenoh)
    edge.event("a fault")
    await_entries(gateway, edge, lambda found: len(found) >= 2)
    edge.silent = True  # until the word is STALE, and the segment closed
    last = until(
        "the same",
        lambda: (found := list_entries(relay)) and found[-1]["words"][-1]["word"] != "online" and found,
    )
    until("the same at the gateway", lambda: list_entries(gateway) == last)
    for entry in last:
        path = f"/public/{entry['take']}/{entry['index']}"
        there, here = ask(relay, path), ask(gateway, path)
        assert (there.status_code, here.content) == (200, there.content)
        assert here.headers["etag"] == there.headers["etag"]
    schema = f"/public/schema/{last[0]['schema']}"
    assert ask(gateway, schema).content == ask(relay, schema).content
    written, read = figures(port), figures(beside)
    assert written["posecast_past_redis_segments_total|written"] >= len(last)
    assert written["posecast_past_redis_segments_total|dropped"] == 0
    for found in (written, read):
        assert found["posecast_past_redis_up"] == 1
        assert found["posecast_past_redis_losses_total"] == 0
        assert found["posecast_past_redis_passed_over_total"] == 0
        assert found["posecast_past_redis_seconds_count"] > 0
        assert found["posecast_past_held_requests"] == found["posecast_past_turned_away_requests_total"] == 0
    assert "posecast_past_bytes" not in read
    redis_server.kill()
    edge.silent = False
    until("it says so", lambda: ask(gateway).status_code == 503)
    assert ask(gateway).headers["retry-after"] == "1"
    assert ask(relay).status_code == 200

    def is_told() -> bool:
        edge.force_key = True  # so that a segment is closed soon
        return "queueing up to" in relay.errors()

    until("a line", is_told)
    assert relay.stop() == gateway.stop() == 0


def test_a_takeover_leaves_takes_that_merge(
    relays: Callable[..., Relay], edges: Callable[..., ZenohEdge], redis_server: Redis
) -> None:
    store = ("--store", redis_server.url, *PAST)
    first, second = (relays("--role", "ingest", *store) for _ in range(2))
    gateway = relays("--role", "gateway", *store)
    edge = edges(first.zenoh, also=[second.zenoh])
    before = await_entries(gateway, edge, overlap)
    first.stop(signal.SIGKILL)
    await_entries(gateway, edge, lambda found: len(found) >= len(before) + 2)
    seq = max(entry["last_seq"] for entry in list_entries(gateway))
    assert second.stop(signal.SIGTERM) == 0  # what was open is closed and goes to Redis
    until("the last one", lambda: max(entry["last_seq"] for entry in list_entries(gateway)) > seq)
    paths = [f"/public/{entry['take']}/{entry['index']}" for entry in list_entries(gateway)]
    parts = [decode_segment(ask(gateway, path).content) for path in paths]
    seqs = {(part.start.run_id, frame.seq) for part in parts for frame in part.frames}
    numbers = sorted(number for _, number in seqs)
    assert len({run for run, _ in seqs}) == 1
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))  # nothing is lacking
    assert len(seqs) < sum(len(part.frames) for part in parts)  # they overlap
