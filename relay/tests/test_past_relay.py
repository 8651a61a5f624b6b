"""The past of a real relay: what was live a moment ago, by HTTP, as those may see it who may."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx
import pytest
from posecast_relay.config.robots_reader import RobotsError
from posecast_relay.config.settings import parse
from posecast_relay.server.access import load_robots
from posecast_testing import free_port, until
from posecast_wire import Decoder
from posecast_wire.segment import CopyRecord, FrameRecord, decode_segment

from .redis_server import Redis
from .stage import Relay, Watcher, ZenohEdge
from .test_observability import figures


def write(file: Path, text: str) -> None:
    """The policy, all at once."""
    new = file.with_suffix(".new")
    new.write_text(text)
    new.chmod(0o600)
    new.rename(file)


def await_segment(relay: Relay, edge: ZenohEdge, index: int = 0) -> dict[str, Any]:
    """Wait for a segment of this index or a later one; KEYs come often, so that it is closed soon."""

    def look() -> dict[str, Any] | None:
        edge.force_key = True
        found = find_newest(relay)
        return found if found is not None and found["index"] >= index else None

    return until(f"segment {index}", look, 30.0)


def find_newest(relay: Relay) -> dict[str, Any] | None:
    """What the past of `r` says of its newest segment; None without one."""
    answer = httpx.get(f"http://{relay.address}/api/v1/robots/r/past")
    found: dict[str, Any] | None = answer.json()["newest"] if answer.status_code == 200 else None
    return found


def read_segments(relay: Relay, since: dict[str, Any], count: int) -> list[Any]:
    """So many segments from this one on, by the route that holds the next one."""
    found: list[Any] = []
    at = dict(since)
    while len(found) < count:
        base = f"http://{relay.address}/api/v1/robots/r/past/public"
        answer = httpx.get(f"{base}/{at['take']}/{at['index']}", timeout=20)
        assert answer.status_code in (200, 204), answer.text
        if answer.headers.get("content-type") == "application/json":
            at = answer.json()["next"]
        elif answer.status_code == 200:
            found.append(decode_segment(answer.content))
            at["index"] += 1
    return found


async def test_the_past_is_what_was_live_byte_for_byte(
    relays: Callable[..., Relay], edges: Callable[..., ZenohEdge]
) -> None:
    relay = relays("--past", "memory:")
    edge = edges(relay.zenoh)
    async with Watcher(relay.url(query="?hz=60")) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 10)
        edge.event("a fault")
        newest = await asyncio.to_thread(await_segment, relay, edge, 2)
        segments = await asyncio.to_thread(read_segments, relay, {**newest, "index": 0}, 3)
    live = dict(viewer.payloads)
    seqs = [frame.seq for segment in segments for frame in segment.frames]
    assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))  # nothing is lacking
    both = [frame for segment in segments for frame in segment.frames if frame.seq in live]
    assert len(both) > 10
    assert all(frame.frame == live[frame.seq] for frame in both)
    texts = [getattr(record, "text", "") for segment in segments for record in segment.records]
    assert sum('"a fault"' in text for text in texts) == 1
    for segment in segments:  # each stands alone
        decoder = Decoder()
        schema = f"http://{relay.address}/api/v1/robots/r/past/public/schema/{segment.start.schema}"
        decoder.add_schema(httpx.get(schema).text)
        frames = [each for each in segment.records if isinstance(each, (CopyRecord, FrameRecord))]
        assert [decoder.decode(each.frame).seq for each in frames][-1] == segment.frames[-1].seq


def test_a_blackout_and_a_stop(
    tmp_path: Path, relays: Callable[..., Relay], edges: Callable[..., ZenohEdge]
) -> None:
    file = tmp_path / "robots.toml"
    write(file, "[robots.r.anyone]\n")
    relay = relays("--past", "memory:", "--robots", str(file))
    edge = edges(relay.zenoh)

    newest = await_segment(relay, edge)
    address = f"http://{relay.address}/api/v1/robots/r/past/public/{newest['take']}/{newest['index']}"
    before = httpx.get(address)
    assert before.status_code == 200
    write(file, "[robots.r.anyone]\nblackout = true\n")
    until("all of it is closed", lambda: httpx.get(address).status_code == 404)
    assert httpx.get(address).headers["cache-control"] == "public, max-age=1"
    by_token = httpx.get(address, headers={"authorization": "Bearer x"})
    assert by_token.headers["cache-control"] == "private, no-store"
    write(file, "[robots.r.anyone]\nview = 'public'\n")
    until("what was before is open again", lambda: httpx.get(address).status_code == 200)
    assert httpx.get(address).content == before.content
    write(file, "[robots.r.anyone]\npast = 0\n")
    until("it has no past any more", lambda: httpx.get(address).status_code == 404)
    write(file, "[robots.r.anyone]\npast = '1h'\nhz = 5\n")
    until("one line", lambda: "past: not together with `hz`" in relay.errors())
    assert relay.stop(signal.SIGTERM) == 0


def test_a_robot_that_is_removed_loses_its_past(
    tmp_path: Path, relays: Callable[..., Relay], edges: Callable[..., ZenohEdge]
) -> None:
    file = tmp_path / "robots.toml"
    write(file, "[robots.r.anyone]\n")
    relay = relays("--past", "memory:", "--robots", str(file))
    newest = await_segment(relay, edges(relay.zenoh))
    robot = f"http://{relay.address}/api/v1/robots/r"
    write(file, "# none\n")
    until("it is gone", lambda: httpx.get(robot).status_code == 404)
    write(file, "[robots.r.anyone]\n")
    until("another has its name", lambda: httpx.get(robot).status_code == 200)
    answer = httpx.get(f"{robot}/past/public/{newest['take']}/{newest['index']}")
    assert answer.status_code == 404


async def test_requests_that_are_held_do_not_hold_up_the_end(
    relays: Callable[..., Relay], edges: Callable[..., ZenohEdge]
) -> None:
    relay = relays("--past", "memory:")
    edge = edges(relay.zenoh)
    newest = await asyncio.to_thread(await_segment, relay, edge)
    edge.silent = True
    base = f"http://{relay.address}/api/v1/robots/r/past/public/{newest['take']}"
    async with httpx.AsyncClient(timeout=20) as client:
        index = newest["index"]
        while (await client.head(f"{base}/{index}")).status_code == 200:
            index += 1
        held = [asyncio.create_task(client.get(f"{base}/{index}")) for _ in range(5)]
        await asyncio.wait(held, timeout=0.2)
        relay.process.send_signal(signal.SIGTERM)
        answers = await asyncio.gather(*held)
    assert {answer.status_code for answer in answers} <= {200, 204}
    assert {answer.headers["connection"] for answer in answers} == {"close"}  # on to another relay
    assert relay.stop() == 0


def test_without_a_past(tmp_path: Path, relays: Callable[..., Relay], redis_server: Any) -> None:
    file = tmp_path / "robots.toml"
    write(file, "[robots.r.anyone]\n[robots.hidden]\n")
    none = relays("--past", "0")
    gateway = relays(
        *("--past", "0", "--role", "gateway", "--store", redis_server.url, "--robots", str(file))
    )
    for relay in (none, gateway):
        summary = httpx.get(f"http://{relay.address}/api/v1/robots/r/past")
        assert summary.status_code == 200
        assert {"past_ms": 0, "newest": None, "days": []}.items() <= summary.json().items()
        for path in ("/public/2026-11-22", f"/public/{'0' * 16}/0"):
            answer = httpx.get(f"http://{relay.address}/api/v1/robots/r/past{path}")
            assert answer.status_code == 501
            assert answer.json()["error"].startswith("this process keeps no past: ask a relay that")
    assert httpx.get(f"http://{gateway.address}/api/v1/robots/hidden/past").status_code == 404


def test_keep_without_a_store_is_refused_in_one_line(tmp_path: Path) -> None:
    file = tmp_path / "robots.toml"
    write(file, "[robots.r]\nkeep = '30d'\n")
    settings = parse(["run", "--dev", "--robots", str(file)], {})
    with pytest.raises(RobotsError) as error:
        load_robots(settings)
    assert str(error.value).startswith(f"{file}: [robots.r] keep: needs an object store")
    assert "\n" not in str(error.value)
    for given in (["--past", "file:///srv/past"], ["--role", "gateway", "--store", "redis://h:1"]):
        assert load_robots(parse(["run", "--dev", "--robots", str(file), *given], {})) is not None


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
