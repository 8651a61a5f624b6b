"""`--workers N`: several processes, one relay. Which one a viewer is at makes no difference to anybody."""

from __future__ import annotations

import asyncio
import math
import os
import re
import signal
from collections.abc import Callable
from contextlib import AsyncExitStack
from functools import partial
from pathlib import Path

import httpx
import pytest
from posecast_relay.config.settings import SettingsError, parse
from posecast_relay.server.workers.feed import STUCK_S
from posecast_testing import free_port, until
from posecast_wire import Close

from .redis_server import Redis
from .stage import Model, Relay, Watcher, ZenohEdge
from .test_past_relay import await_segment, write
from .worker_crew import SLOW_S, ask_at, await_ready, list_pids, read_metric, until_metric, watch_at

Relays = Callable[..., Relay]
Edges = Callable[..., ZenohEdge]
API = "/api/v1/robots"


async def test_viewers_of_all_workers_see_the_same_robot(relays: Relays, edges: Edges) -> None:
    port = free_port()
    relay = relays("--workers", "2", "--metrics-port", str(port))
    first, second = list_pids(relay)
    edge = edges(relay.zenoh, model=Model({"robot.urdf": (b"<robot/>", "application/xml")}))
    assert edge.model is not None
    async with AsyncExitStack() as stack:
        watchers = [await watch_at(relay, pid, stack, "?hz=60") for pid in (first, second, second)]
        for watcher in watchers:
            await watcher.until("frames", lambda v: len(v.frames) > 30)
        edge.event("one")
        for watcher in watchers:
            await watcher.until("an event", lambda v: v.told("event"))
        watchers.append(await watch_at(relay, second, stack))  # who comes later is told of it as well
        await watchers[-1].until("an event", lambda v: v.told("event"))
        said = [watcher.told("event")[0] for watcher in watchers]
        assert said == [said[0]] * 4
        assert said[0]["n"] == 1
        seqs = [frame.seq for _, frame in watchers[1].frames]
        assert seqs == sorted(set(seqs))
        assert all(watchers[0].payloads.get(seq, data) == data for seq, data in watchers[1].payloads.items())

        # what is asked over HTTP is the same everywhere
        for pid in (first, second):
            until("four viewers", partial(has_viewers, relay, pid, 4))
            assert ask_at(relay, pid, f"{API}/r").json()["viewers"] == 4
            manifest = ask_at(relay, pid, f"{API}/r/model/{edge.model.digest}/manifest.json")
            assert manifest.content == edge.model.manifest
            assert manifest.headers["access-control-allow-origin"] == "*"
            head = ask_at(relay, pid, f"{API}/r", "HEAD")
            assert (head.status_code, head.content) == (200, b"")
            assert int(head.headers["content-length"]) > 100
            listed = ask_at(relay, pid, API)
            had = ask_at(relay, pid, API, **{"if-none-match": listed.headers["etag"]})
            assert (
                had.status_code == 304 or had.headers["etag"] != listed.headers["etag"]
            )  # a second has passed
            assert "publish_at" in listed.json()
            assert "publish_at" in ask_at(relay, pid, API, **{"x-posecast-peer": "10.0.0.1"}).json()
            assert "publish_at" not in ask_at(relay, pid, API, **{"x-forwarded-for": "10.0.0.1"}).json()
            assert "publish_at" not in ask_at(relay, pid, API, host="elsewhere.example").json()
            assert ask_at(relay, pid, f"{API}/r/state", "POST").status_code == 405
            assert ask_at(relay, pid, f"{API}/r/live.sse", "HEAD").status_code == 405
            assert ask_at(relay, pid, "/nothing").status_code == 404
        newest = await asyncio.to_thread(await_segment, relay, edge)
        address = f"{API}/r/past/public/{newest['take']}/{newest['index']}"
        segments = [ask_at(relay, pid, address) for pid in (first, second)]
        assert segments[0].content == segments[1].content != b""
        assert segments[0].headers["etag"] == segments[1].headers["etag"]
        assert "date" in segments[1].headers

        # as of one relay
        await asyncio.to_thread(until_metric, port, "posecast_viewers", 4)
        await asyncio.to_thread(until_metric, port, "posecast_workers", 2)
        frames = sum(len(watcher.frames) - 2 for watcher in watchers)  # bases come along
        await asyncio.to_thread(until_metric, port, "posecast_delivered_frames_total", frames, math.inf)
        edge.close()
        before = [len(watcher.frames) for watcher in watchers]
        again = edges(relay.zenoh, run_id=0xF0)  # the robot's software was started again
        for watcher, count in zip(watchers, before, strict=True):
            await watcher.until("frames of the new run", partial(has_more, count + 5))
        again.event("two")
        for watcher in watchers:
            await watcher.until("an event", lambda v: len(v.told("event")) == 2)
            assert watcher.told("event")[-1]["n"] == 2
    assert relay.stop() == 0


ROBOTS = """
[robots.r.anyone]
view = "public"
viewers = 3
{more}
[robots.late.anyone]
view = "public"
delay_s = 1
"""


@pytest.mark.full  # that several workers serve, the first test says
async def test_limits_and_rules_are_those_of_one_relay(relays: Relays, edges: Edges, tmp_path: Path) -> None:
    robots = tmp_path / "robots.toml"
    write(robots, ROBOTS.format(more=""))
    flags = ("--robots", str(robots), "--max-per-address", "2", "--trusted-proxies", "127.0.0.1")
    relay = relays("--workers", "2", "--max-viewers", "5", *flags)
    first, second = list_pids(relay)
    for robot in ("r", "late"):
        edges(relay.zenoh, robot=robot)
    async with AsyncExitStack() as stack:

        async def come(pid: int, robot: str = "r") -> Watcher:
            watcher = await watch_at(relay, pid, stack, "", robot)
            await watcher.until("frames or an end", lambda v: v.frames or v.closed)
            return watcher

        here = [await come(first), await come(second), await come(first)]
        assert [each.closed for each in here] == [None] * 3
        for pid in (first, second):
            refused = await come(pid)
            await refused.until("an end", lambda v: v.closed)
            assert refused.closed == (Close.FULL, "this robot has no room for more viewers")
        late = [await come(first, "late"), await come(second, "late")]  # two more: now the relay is full
        for each in late:
            await each.until("frames", lambda v: v.frames)
        for pid in (first, second):
            refused = await come(pid, "late")
            await refused.until("an end", lambda v: v.closed)
            assert refused.closed == (Close.FULL, "the relay has no room for more viewers")
        leaves = late.pop().connection
        assert leaves is not None
        await leaves.close()

        async def gets_in() -> bool:
            return not (await come(first, "late")).closed

        while not await gets_in():  # a place is free again, at the other worker
            await asyncio.sleep(0.05)

        write(robots, ROBOTS.format(more="blackout = true"))
        for each in here:
            await each.until("it is closed to all", lambda v: v.closed, 15.0)
            assert each.closed is not None
            assert each.closed[0] == Close.ABSENT

    async def stream(client: httpx.AsyncClient, stack: AsyncExitStack) -> int:
        headers = {"x-forwarded-for": "10.1.2.3"}
        answer = await stack.enter_async_context(
            client.stream("GET", f"{API}/late/live.sse", headers=headers)
        )
        return answer.status_code

    async with AsyncExitStack() as stack:
        found: list[int] = []
        for _ in range(12):  # each on a connection of its own, at one worker or the other
            client = await stack.enter_async_context(httpx.AsyncClient(base_url=f"http://{relay.address}"))
            found.append(await stream(client, stack))
        assert found.count(200) == 2
        assert found.count(503) == 10


@pytest.mark.full  # that several workers serve, the first test says
async def test_a_worker_that_was_killed_comes_back(relays: Relays, edges: Edges) -> None:
    port = free_port()
    relay = relays("--workers", "2", "--max-viewers", "3", "--metrics-port", str(port))
    first, second = list_pids(relay)
    edges(relay.zenoh)
    async with AsyncExitStack() as stack:
        stays = await watch_at(relay, first, stack, "?hz=60")
        gone = [await watch_at(relay, second, stack) for _ in range(2)]
        for watcher in (stays, *gone):
            await watcher.until("frames", lambda v: len(v.frames) > 5)
        delivered = read_metric(port, "posecast_delivered_frames_total")
        seq = stays.frames[-1][1].seq
        os.kill(second, signal.SIGKILL)
        for watcher in gone:
            await watcher.until("cut", lambda v: v.closed)

        def find_missing() -> httpx.Response | None:
            answer = httpx.get(f"http://{relay.address}/readyz", timeout=SLOW_S)
            return answer if answer.json() != {"status": "ready"} else None

        # in threads: a viewer that took nothing meanwhile would miss frames by its own fault
        answer = await asyncio.to_thread(until, "it is missed", find_missing)
        assert answer.status_code == 200, "the others serve"
        assert answer.json() == {"status": "degraded", "why": "not serving: worker 1 of 2"}
        assert await asyncio.to_thread(read_metric, port, "posecast_delivered_frames_total") >= delivered
        await asyncio.to_thread(await_ready, relay)
        assert list_pids(relay)[1] != second
        await asyncio.to_thread(until_metric, port, "posecast_worker_restarts_total", 1)
        await asyncio.to_thread(until_metric, port, "posecast_viewers", 1)
        new = [await watch_at(relay, list_pids(relay)[1], stack) for _ in range(2)]  # their places are free
        for watcher in new:
            await watcher.until("frames", lambda v: len(v.frames) > 5)
        for pid in list_pids(relay):  # wherever somebody is told `full`, they are told the lane
            refused = await watch_at(relay, pid, stack)
            await refused.until("an end", lambda v: v.closed)
            assert refused.told("bye")[0]["lane"] == "past/public"
        await asyncio.to_thread(until_metric, port, "posecast_lane_viewers_total", 2)
        assert stays.closed is None
        assert stays.most_missed(seq) < 30  # a second: to start a worker takes longer
        await asyncio.to_thread(
            until_metric, port, "posecast_delivered_frames_total", delivered + 10, math.inf
        )
    assert "worker 1 exited with status -9: restarting it" in relay.errors()


@pytest.mark.full
async def test_a_worker_that_stands_still_holds_nobody_up(relays: Relays, edges: Edges) -> None:
    port = free_port()
    relay = relays("--workers", "2", "--metrics-port", str(port))
    first, second = list_pids(relay)
    edge = edges(relay.zenoh)
    async with AsyncExitStack() as stack:
        moving = await watch_at(relay, first, stack, "?hz=60")
        still = await watch_at(relay, second, stack, "?hz=60")
        for watcher in (moving, still):
            await watcher.until("frames", lambda v: len(v.frames) > 5)
        os.kill(second, signal.SIGSTOP)
        try:
            seq, came = edge.seq, 0
            async with asyncio.timeout(60):
                while came < 5:  # while its metrics are waited for, for ANSWER_S
                    before = len(moving.frames)
                    assert await asyncio.to_thread(read_metric, port, "posecast_workers") == 2
                    came = len(moving.frames) - before
            await moving.until("frames go on", lambda v: v.frames[-1][1].seq > seq + 60, SLOW_S)
            missing = partial(read_metric, port, 'posecast_workers{state="missing"}')
            assert await asyncio.to_thread(missing) == 1
        finally:
            os.kill(second, signal.SIGCONT)
        # not what was on its way to it
        await still.until("up to date", lambda v: v.frames[-1][1].seq >= edge.seq - 15, SLOW_S)
        seqs = [frame.seq for _, frame in still.frames]
        assert seqs == sorted(set(seqs))
        assert moving.most_missed(seq) < edge.hz * STUCK_S / 2  # it took nothing for STUCK_S at most


@pytest.mark.full
def test_a_worker_that_hangs_is_replaced(relays: Relays) -> None:
    port = free_port()
    relay = relays("--workers", "2", "--metrics-port", str(port))
    _, second = list_pids(relay)
    os.kill(second, signal.SIGSTOP)
    until("it is killed", lambda: read_metric(port, "posecast_worker_restarts_total") == 1, 60)
    await_ready(relay)
    assert list_pids(relay)[1] != second
    assert "worker 1 does not respond: killing it" in relay.errors()


@pytest.mark.full  # that several workers serve, the first test says
async def test_all_drain_as_one_and_end_with_the_first(relays: Relays, edges: Edges) -> None:
    folders: list[Path] = []
    for how, status in ((signal.SIGKILL, -signal.SIGKILL), (signal.SIGTERM, 0)):
        relay = relays("--workers", "2")
        pids = list_pids(relay)
        folders += map(Path, list_folders(pids[1]))
        edges(relay.zenoh)
        async with AsyncExitStack() as stack:
            watchers = [await watch_at(relay, pid, stack) for pid in pids]
            for watcher in watchers:
                await watcher.until("frames", lambda v: v.frames)
            for pid in pids[1:]:  # as a service manager or a terminal does, which signals all at once
                os.kill(pid, signal.SIGTERM)
                os.kill(pid, signal.SIGINT)
            stopped = await asyncio.to_thread(relay.stop, how)
            assert stopped == status
            for watcher in watchers:
                await watcher.until("told to go", lambda v: v.closed)
                assert watcher.closed is not None
                assert status != 0 or watcher.closed[0] == Close.DRAIN
        for pid in pids[1:]:
            until("it ends", partial(is_gone, pid))
    assert len(folders) == 2
    assert not any(map(Path.exists, folders))  # the second one has removed what the first one left


def has_viewers(relay: Relay, pid: int, count: int) -> bool:
    """Whether the first robot has so many viewers, as this process says."""
    return bool(ask_at(relay, pid, API).json()["robots"][0]["viewers"] == count)


def has_more(count: int, viewer: Watcher) -> bool:
    """Whether a viewer has more frames than so many."""
    return len(viewer.frames) > count


def list_folders(pid: int) -> list[str]:
    """The folder of sockets that a further worker was told of."""
    return re.findall(r'"folder":"([^"]+)"', Path(f"/proc/{pid}/cmdline").read_text())


def is_gone(pid: int) -> bool:
    """Whether this process has ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


@pytest.mark.full
async def test_with_redis_all_workers_serve_on_when_it_is_gone(
    relays: Relays, edges: Edges, redis_server: Redis
) -> None:
    relay = relays("--workers", "2", "--store", redis_server.url)
    gateway = relays("--role", "gateway", "--workers", "2", "--store", redis_server.url, zenoh_port=7448)
    edges(relay.zenoh)
    async with AsyncExitStack() as stack:
        watchers = [await watch_at(relay, pid, stack) for pid in list_pids(relay)]
        beyond = [await watch_at(gateway, pid, stack) for pid in list_pids(gateway)]
        for watcher in (*watchers, *beyond):
            await watcher.until("frames", lambda v: len(v.frames) > 5)
        for each in (relay, gateway):
            for pid in list_pids(each):
                until("four viewers", partial(has_viewers, each, pid, 4))
        redis_server.kill()
        for watcher in beyond:
            await watcher.until("degraded", lambda v: v.told("status")[-1].get("degraded"))
        seen = [len(watcher.frames) for watcher in watchers]
        for watcher, n in zip(watchers, seen, strict=True):
            await watcher.until("frames go on", partial(has_more, n + 30))
            assert not any(status.get("degraded") for status in watcher.told("status"))


@pytest.mark.parametrize("text", ["0", "65", "two", "-1", "1e1", "9" * 5000])
def test_a_wrong_number_of_workers_is_one_line(text: str) -> None:
    with pytest.raises(SettingsError) as raised:
        parse(["run", "--dev", "--workers", text], {})
    assert str(raised.value).endswith("use a number from 1 to 64")
