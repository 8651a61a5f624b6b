"""Edges through a real Zenoh link: recovery, liveness, echo, and what is dropped."""

from __future__ import annotations

import asyncio
import time
from typing import Any

import httpx
import zenoh
from posecast_testing import free_port, until
from posecast_wire import Echo, frame_key

from .stage import Relay, Watcher

KEY_EVERY = 900  # frames of the edge on the stage


def listed(relay: Relay, robot: str = "r") -> dict[str, Any]:
    """What the relay says of a robot."""
    found = httpx.get(f"http://{relay.address}/api/v1/robots").json()["robots"]
    return next((r for r in found if r["robot"] == robot), {})


async def test_one_lost_key_costs_a_second_not_an_interval(relay: Relay, edges: Any) -> None:
    edge = edges(relay)
    async with Watcher(relay.url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 60)
        edge.lose_next_key = edge.force_key = True
        await viewer.until("the loss", lambda v: edge.lost_at is not None)
        lost = edge.seq
        await viewer.until("frames after it", lambda v: v.frames[-1][1].seq > lost + 30)
        assert viewer.most_missed(lost - 30) < KEY_EVERY / 3
        assert viewer.frames[-1][1].codes == (viewer.frames[-1][1].seq,) * 2


async def test_a_restarted_relay_needs_no_key(relays: Any, edges: Any) -> None:
    relay = relays()
    edge = edges(relay.zenoh)
    async with Watcher(relay.url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 30)
    relay.process.kill()
    relay.stop()
    again = relays(http=relay.http, zenoh_port=relay.zenoh_port)
    restarted = edge.seq
    async with Watcher(again.url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 10)
        assert viewer.frames[0][1].seq < restarted  # its KEY, from before
        assert viewer.told("schema")
        assert viewer.frames[-1][1].seq > 30
    assert edge.edge.run_id == 0xE


async def test_silent_is_not_offline(relay: Relay, edges: Any) -> None:
    edge = edges(relay)
    async with Watcher(relay.url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 5)
        edge.silent = True
        await viewer.until("silent", lambda v: v.told("status")[-1]["robot"] == "silent", 5.0)
        edge.close()
        await viewer.until("offline", lambda v: v.told("status")[-1]["robot"] == "offline", 30.0)
    async with Watcher(relay.url()) as late:
        await late.until("a few seconds", lambda v: len(v.told("status")) > 3)
        assert {s["robot"] for s in late.told("status")} == {"offline"}
        assert {frame.seq for _, frame in late.frames} <= {0, edge.seq}  # its KEY and the last pose


async def test_echo_tells_the_edge_what_has_arrived(relay: Relay, edges: Any) -> None:
    edge = edges(relay)
    begun_s = time.time()

    def heard() -> Echo | None:
        echo = edge.echo()
        return echo if echo is not None and echo.run_id == 0xE and echo.seq > 5 else None

    echo = await asyncio.to_thread(until, "an echo", heard)
    assert begun_s <= echo.relay_time_s <= time.time()
    assert edge.seq - 10 <= echo.seq <= edge.seq
    stranger = edges(relay, robot=f"{relay.robot}-other")
    stranger.silent = True
    stranger.robot = f"{relay.robot}-nobody"
    assert stranger.echo() is not None
    assert stranger.echo().run_id == 0


async def test_the_newest_of_two_edges_wins_and_a_conflict_shows(relay: Relay, edges: Any) -> None:
    edges(relay)
    async with Watcher(relay.url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 30)
        edges(relay, run_id=0xF)
        await viewer.until("the new run", lambda v: v.frames[-1][1].seq < 20)
        since = len(viewer.frames)
        await viewer.until("the conflict", lambda v: v.told("event"))
        seqs = [frame.seq for _, frame in viewer.frames[since:]]
        assert seqs == sorted(seqs)
        assert viewer.told("event")[0]["text"] == "another edge claims this robot"
    assert httpx.get(relay.api).json()["conflict"] is True


async def test_what_is_no_frame_of_ours_is_counted_and_leaves_no_trace(relays: Any, edges: Any) -> None:
    port = free_port()
    relay = relays("--metrics-port", str(port), "--log-level", "info")
    edge = edges(relay.zenoh)
    await asyncio.to_thread(until, "on air", lambda: listed(relay).get("status") == "online")
    stamp = edge.edge.stamp(time.monotonic()).pack()
    session: zenoh.Session = edge.session

    def put(key: str, payload: bytes, attachment: bytes | None = stamp) -> None:
        block = zenoh.CongestionControl.BLOCK
        session.put(key, payload, attachment=attachment, congestion_control=block)

    put(frame_key("r", "public"), b"\x20later")
    put(frame_key("r", "public"), b"\x10")
    put(frame_key("r", "public"), bytes([0x10]) * 70_000)
    put(frame_key("r", "public"), b"\x10" + bytes(20), None)  # no stamp
    put("posecast/v1/R2D2/public/frame", b"\x10" + bytes(20))
    put("posecast/v1/r/Public/event", b"{}")
    put("posecast/v1/r/public/event", b"\xff")

    def counted() -> bool:
        text = httpx.get(f"http://127.0.0.1:{port}/metrics").text
        wanted = ('{fate="bad"} 5.0', '{fate="version"} 1.0', '{fate="oversized"} 1.0')
        return all("posecast_edge_frames_total" + w in text for w in wanted)

    await asyncio.to_thread(until, "all are counted", counted)
    assert listed(relay).get("status") == "online"
    told = [line for line in relay.errors().splitlines() if '"level": "warning"' in line]
    assert len(told) == 2  # all counted, one told of each robot that is here, and one of all others
    # frames and events come in threads of their own, and inboxes are emptied in turns
    of_others, of_r = sorted(told, key=lambda line: "R2D2" not in line)
    assert "R2D2/public/frame: robot 'R2D2'" in of_others
    first_of_r = (
        "r/public/frame: a frame has an unknown wire format version",
        "r/Public/event: view 'Public'",
    )
    assert any(line in of_r for line in first_of_r)


async def test_a_robot_that_found_no_place_has_one_when_another_has_gone(relays: Any, edges: Any) -> None:
    relay = relays("--max-robots", "1", "--log-level", "info")
    first = edges(relay.zenoh)
    await asyncio.to_thread(until, "the first is on air", lambda: listed(relay).get("status") == "online")
    edges(relay.zenoh, robot="second")
    await asyncio.to_thread(until, "it is said", lambda: "second/alive: the relay has" in relay.errors())
    first.close()
    await asyncio.to_thread(
        until, "the second is on air", lambda: listed(relay, "second").get("status") == "online", 30.0
    )


async def test_keys_that_leave_the_robot_open_are_counted_and_answered_by_nobody(
    relays: Any, edges: Any
) -> None:
    port = free_port()
    relay = relays("--metrics-port", str(port))
    edge = edges(relay.zenoh)
    await asyncio.to_thread(until, "on air", lambda: listed(relay).get("status") == "online")
    stamp = edge.edge.stamp(time.monotonic()).pack()
    opened = ("**", "posecast/**", "posecast/v1/**", "posecast/v1/*/public/frame", "posecast/v1/*/*/event")
    for key in opened:
        edge.session.put(key, b"x", attachment=stamp, congestion_control=zenoh.CongestionControl.BLOCK)
    for key in ("posecast/**", "posecast/v1/*/echo"):
        answered = [str(reply.ok.key_expr) for reply in edge.session.get(key, timeout=2.0) if reply.ok]
        assert not [key for key in answered if key.endswith("echo")]  # the edge answers for itself

    def counted() -> bool:
        text = httpx.get(f"http://127.0.0.1:{port}/metrics").text
        bad = next(line for line in text.splitlines() if 'edge_frames_total{fate="bad"}' in line)
        return float(bad.rsplit(" ", 1)[1]) >= len(opened) + 2

    await asyncio.to_thread(until, "all are counted", counted)
    assert '"level": "error"' not in relay.errors()
    assert listed(relay).get("status") == "online"
