"""The policy at every door: stream, events, state, list and document all show one audience one view."""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
import websockets
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.core.policy import Audience, Grant, Principal
from posecast_relay.core.viewer import Viewer
from posecast_testing import until
from posecast_wire import Close

from .sim import UNIX_S, Screen, World, schema
from .stage import Relay, Watcher, request_stream

CANARY = "CANARY-7319"


def grant(hz: float = 60.0, viewers: int | None = None, by: Audience = Audience.ANYONE, **more: Any) -> Grant:
    """Of the robot `r`."""
    return Grant(
        *("r", more.get("view", "public"), hz, more.get("delay_s", 0.0)),
        viewers=viewers,
        by=by,
        who=Principal(),
    )


def join(world: World, granted: Grant, hz: float = 30.0) -> tuple[Viewer, Screen]:
    """A viewer with that grant."""
    screen = Screen()
    viewer = Viewer(screen, "r", granted.view, hz, world.limits, world.now, grant=granted)
    world.do(world.hub.join(viewer, world.now, UNIX_S))
    return viewer, screen


# ---- by plain calls ---------------------------------------------------------


def test_a_rate_is_capped_by_the_grant() -> None:
    world = World()
    edge = world.on_air()
    viewer, screen = join(world, grant(hz=5.0))
    assert screen.texts[0]["hz"] == 5.0
    assert screen.texts[0]["limits"]["max_hz"] == 5.0
    world.say(viewer, type="rate", hz=60)
    assert screen.told("rate")[-1] == {"type": "rate", "hz": 5.0, "reason": "limit"}
    world.run(edge, 2.0)
    assert 9 <= len(screen.states) <= 15  # of 60; at first the source's own rate is not known


def test_viewers_are_capped_by_audience_and_leave_room_when_they_go() -> None:
    world = World()
    world.on_air()
    first, _ = join(world, grant(viewers=1))
    _, second = join(world, grant(viewers=1))
    assert second.ended is not None
    assert second.ended[0] is Close.FULL
    _, other = join(world, grant(viewers=1, by=Audience.LINK))
    assert other.ended is None
    world.hub.remove_viewer(first)
    world.hub.remove_viewer(first)
    _, third = join(world, grant(viewers=1))
    assert third.ended is None


def test_a_grant_that_changes_is_told() -> None:
    world = World()
    world.on_air()
    viewer, screen = join(world, grant())
    world.do(world.hub.replace_grant(viewer, grant(hz=10.0), world.now))
    assert screen.told("rate")[-1] == {"type": "rate", "hz": 10.0, "reason": "limit"}
    world.do(world.hub.replace_grant(viewer, grant(hz=60.0), world.now))
    world.say(viewer, type="rate", hz=60)
    assert screen.told("rate")[-1]["hz"] == 60.0


@pytest.mark.parametrize("more", [{"view": "lab"}, {"delay_s": 5.0}, {"by": Audience.SIGNED_IN}], ids=str)
def test_a_grant_to_see_something_else_ends_the_viewer(more: dict[str, Any]) -> None:
    world = World()
    world.on_air()
    viewer, screen = join(world, grant())
    world.do(world.hub.replace_grant(viewer, grant(**more), world.now))
    assert screen.ended is not None
    assert screen.ended[0] is Close.AGE_LIMIT, "and returns at once, to what it may see now"


def test_two_hubs_of_a_process_share_its_limit() -> None:
    world = World(Limits(viewers=2))
    other = Hub(world.limits, world.hub.headcount)
    viewer = Viewer(Screen(), "r", "public", 1.0, world.limits, world.now)
    other.join(viewer, world.now, UNIX_S)
    assert join(world, grant())[1].ended is None
    ended = join(world, grant())[1].ended
    assert ended is not None
    assert ended[0] is Close.FULL


# ---- over real sockets ------------------------------------------------------


class Published:
    """A relay with a policy, and a robot `r` whose view `lab` says more than its public one."""

    def __init__(self, folder: Path, relays: Callable[..., Relay], edges: Callable[..., Any]) -> None:
        self.file = folder / "robots.toml"
        self.write('[robots.r.anyone]\nview = "public"\n')
        self.relay: Relay = relays("--robots", str(self.file))
        self.public = edges(self.relay.zenoh, run_id=0xE)
        self.lab = edges(self.relay.zenoh, run_id=0xE, view="lab", of=schema(("RKN", CANARY)))
        self.base = f"http://{self.relay.address}/api/v1/robots"

    def write(self, text: str) -> None:
        """The policy, from within a second on. All at once, as the command does it."""
        new = self.file.with_suffix(".new")
        new.write_text(text)
        new.chmod(0o600)
        os.replace(new, self.file)

    def listed(self) -> list[dict[str, Any]]:
        """The robots that anyone is shown."""
        found: list[dict[str, Any]] = httpx.get(self.base).json()["robots"]
        return found


@pytest.fixture
def published(tmp_path: Path, relays: Callable[..., Relay], edges: Callable[..., Any]) -> Published:
    """On air."""
    found = Published(tmp_path, relays, edges)
    until("on air", lambda: httpx.get(f"{found.base}/r/state").status_code == 200)
    return found


def raw_bytes(relay: Relay, head: bytes, enough: int) -> bytes:
    """All that comes back on a socket for a request, until it is so much or closed."""
    got = b""
    with socket.create_connection(("127.0.0.1", relay.http), 10) as sock:
        sock.sendall(head)
        while len(got) < enough and (part := sock.recv(65536)):
            got += part
    return got


def test_a_field_outside_the_view_is_in_no_byte(published: Published) -> None:
    relay = published.relay
    heard = until("the lab's view is on air", lambda: published.lab.seq > 5)
    assert heard
    doors = [
        raw_bytes(relay, request_stream("?hz=60"), 1500),
        raw_bytes(relay, request_stream("?hz=60&format=json"), 3000),
        raw_bytes(relay, request_stream("?hz=60&view=lab"), 1500),
        raw_bytes(relay, b"GET /api/v1/robots/r/live.sse?hz=60 HTTP/1.1\r\nHost: x\r\n\r\n", 3000),
        raw_bytes(relay, b"GET /api/v1/robots/r/live.sse?format=json HTTP/1.1\r\nHost: x\r\n\r\n", 3000),
        raw_bytes(relay, b"GET /api/v1/robots/r/live.sse?view=lab HTTP/1.1\r\nHost: x\r\n\r\n", 1500),
    ]
    doors += [
        httpx.get(f"{published.base}{path}").content
        for path in ("", "/r", "/r/state", "/r/state?view=lab", "/r?view=lab", "/lab", "/r/model/x/y")
    ]
    assert all(b"RKN" in doors[n] for n in (0, 1, 3, 4))
    for n, said in enumerate(doors):
        assert CANARY.encode() not in said, n
    assert CANARY not in relay.errors()


async def test_a_view_that_is_not_for_them_is_told_by_4403(published: Published) -> None:
    async with Watcher(published.relay.url(query="?view=lab")) as viewer:
        await viewer.until("the end", lambda v: v.closed is not None)
    assert [doc["type"] for doc in viewer.texts] == ["bye"]
    assert viewer.closed == (Close.FORBIDDEN, "you may not see this view")
    assert httpx.get(f"{published.base}/r/state?view=lab").status_code == 403
    assert httpx.get(f"{published.base}/r/live.sse?view=lab").status_code == 403


async def test_a_robot_that_is_hidden_is_as_one_that_is_not(published: Published) -> None:
    published.write("[robots.r]\n[robots.dark.anyone]\nblackout = true\n")
    until("it is hidden", lambda: published.listed() == [])
    answers = set()
    for robot in ("r", "dark", "no-such"):
        async with Watcher(published.relay.url(robot)) as viewer:
            await viewer.until("the end", lambda v: v.closed is not None)
        said = [json.dumps(doc) for doc in viewer.texts]
        for path in ("", "/state", "/live.sse", f"/model/{'0' * 64}/manifest.json"):
            answer = httpx.get(f"{published.base}/{robot}{path}")
            headers = {name: value for name, value in answer.headers.items() if name != "date"}
            said += [f"{answer.status_code} {headers} {answer.text}"]
        answers.add((viewer.closed, *said))
    assert len(answers) == 1
    assert answers.pop()[0] == (Close.ABSENT, "no such robot, or you may not see it")


async def test_a_policy_that_changes_reaches_those_who_watch(published: Published) -> None:
    async with Watcher(published.relay.url(query="?hz=30")) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 5)
        published.write("[robots.r.anyone]\nhz = 2\n")
        await viewer.until("the rate", lambda v: v.told("rate"))
        assert viewer.told("rate")[-1] == {"type": "rate", "hz": 2.0, "reason": "limit"}
        published.write("[robots.r.anyone]\nhzz = 2\n")
        await viewer.until("one line", lambda _: "unknown field 'hzz'" in published.relay.errors())
        published.write("[robots.r.anyone]\nblackout = true\n")
        await viewer.until("the end", lambda v: v.closed is not None)
    assert viewer.closed is not None
    assert viewer.closed[0] == Close.ABSENT
    assert published.relay.errors().count("unknown field") == 1


async def test_a_blackout_ends_events_and_spreads_their_readers(published: Published) -> None:
    url = f"{published.base}/r/live.sse"
    async with httpx.AsyncClient(timeout=20) as client, client.stream("GET", url) as answer:
        parts = answer.aiter_text()
        text = await anext(parts)
        published.write("[robots.r.anyone]\nblackout = true\n")
        async for part in parts:
            text += part
    assert f'"code":{int(Close.ABSENT)}' in text.replace(" ", "").rsplit("event:bye", 1)[1]
    assert 30_000 <= int(text.rsplit("retry: ", 1)[1]) <= 60_000


async def test_a_delay_is_kept_by_stream_state_and_list(published: Published) -> None:
    delay_s = 1.5
    published.write(f"[robots.r.anyone]\ndelay_s = {delay_s}\nviewers = 1\n")

    def late(url: str) -> bool | None:
        answer = httpx.get(url)
        if answer.status_code != 200:
            return None
        return bool(time.monotonic() - answer.json()["t"] >= delay_s)

    until("the past is shown", lambda: late(f"{published.base}/r/state"))
    async with Watcher(published.relay.url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 20)
        assert viewer.texts[0]["limits"]["delay_s"] == delay_s
        for at, frame in viewer.frames:
            assert at - frame.t_s >= delay_s
        assert viewer.told("status")[-1]["robot"] == "online"
        (listed,) = published.listed()
        assert listed["seq"] < published.public.seq
        assert listed["viewers"] == 1
        async with Watcher(published.relay.url()) as second:
            await second.until("the end", lambda v: v.closed is not None)
        assert second.closed is not None
        assert second.closed[0] == Close.FULL


@pytest.mark.full
async def test_a_gateway_keeps_the_policy_and_the_delay(
    tmp_path: Path, relays: Callable[..., Relay], edges: Callable[..., Any], redis_server: Any
) -> None:
    file = tmp_path / "gateway.toml"
    file.write_text("[robots.r.anyone]\ndelay_s = 1\n[robots.hidden]\n")
    file.chmod(0o600)
    ingest = relays("--role", "ingest", "--store", redis_server.url)
    gateway = relays("--role", "gateway", "--store", redis_server.url, "--robots", str(file))
    for robot in ("r", "hidden"):
        edges(ingest.zenoh, robot=robot)
    base = f"http://{gateway.address}/api/v1/robots"
    async with Watcher(gateway.url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 10, 20.0)
        for at, frame in viewer.frames:
            assert at - frame.t_s >= 1.0
    async with Watcher(gateway.url("hidden")) as nobody:
        await nobody.until("the end", lambda v: v.closed is not None)
    assert nobody.closed is not None
    assert nobody.closed[0] == Close.ABSENT
    assert [robot["robot"] for robot in httpx.get(base).json()["robots"]] == ["r"]
    with pytest.raises(websockets.InvalidStatus):
        await websockets.connect(f"{base.replace('http', 'ws')}/hidden/nothing")
