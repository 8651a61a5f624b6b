"""Who is told the lane, and who is not: in the core, and as it reaches a viewer by each way in."""

from __future__ import annotations

import asyncio
import heapq
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest
import websockets
from posecast_relay.core import messages
from posecast_relay.core.limits import Limits
from posecast_relay.core.policy import (
    ANYONE,
    CROWDED,
    DELAYED,
    DRAINING,
    FULL,
    NO_LOOK_BACK,
    NOT_ALL,
    NOT_OPEN,
    ROBOT_FULL,
    Applicant,
    Audience,
    Grant,
    Occupancy,
    Policy,
    Principal,
    Refusal,
    RetryPace,
    Rule,
    admit,
    explain_no_lane,
    find_lane,
    find_no_room,
)
from posecast_relay.core.viewer import Viewer
from posecast_testing import free_port, until
from posecast_wire import Close

from .sim import UNIX_S, Screen, World, split
from .stage import Relay, Watcher
from .test_sse import parse_events

A, S, L = Audience.ANYONE, Audience.SIGNED_IN, Audience.LINK
LANE = "past/public"
ROOM, NONE_LEFT = Occupancy(9, 10), Occupancy(10, 10)
BOTH = Policy({"r": {A: Rule(), S: Rule("lab"), L: Rule("lab", delay_s=5.0)}})


def enter(applicant: Applicant, policy: Policy = BOTH, occupancy: Occupancy = NONE_LEFT) -> Refusal | None:
    """What somebody is told who joins a process that has a past."""
    grant = admit(applicant, policy, has_past=True)
    assert isinstance(grant, Grant), grant
    return find_no_room(grant, occupancy)


def is_told(found: Refusal | None) -> str | None:
    """The lane of one who was refused since the relay is full."""
    assert found is not None
    assert replace(found, lane=None) == FULL
    return found.lane


def test_only_who_may_see_the_same_as_anyone_and_undelayed_is_told_the_lane() -> None:
    cases: list[tuple[Rule | None, str | None]] = [
        (Rule(), None),
        (Rule(past_s=15.0), None),
        (Rule(past_s=14.0), NO_LOOK_BACK),
        (Rule(hz=60.0, viewers=5), None),
        (Rule(past_s=0.0), NO_LOOK_BACK),
        (Rule(hz=59.9), NOT_ALL),
        (Rule(hz=5.0, past_s=60.0), NOT_ALL),
        (Rule(delay_s=1.0), DELAYED),
        (Rule(delay_s=1.0, past_s=60.0), DELAYED),
        (Rule(blackout=True), NOT_OPEN),
        (Rule(viewers=0), NOT_OPEN),
        (Rule("lab"), NOT_OPEN),
        (None, NOT_OPEN),
    ]
    for rule, why in cases:
        policy = Policy({"r": {L: Rule(), **({} if rule is None else {A: rule})}})
        assert explain_no_lane(policy, "r", "public") == why, rule
        assert find_lane(policy, "r", "public") == (LANE if why is None else None), rule
    assert explain_no_lane(BOTH, "none", None) == NOT_OPEN
    assert (find_lane(Policy(), "any", None), find_lane(Policy(), "any", "lab")) == (LANE, None)
    assert find_lane(Policy({"r": {A: Rule("lab")}}), "r", None) == "past/lab"


def test_whoever_proves_more_is_told_the_lane_of_what_anyone_sees_if_that_is_what_they_asked_for() -> None:
    somebody, holder = Principal(S, token="t"), Principal(L, "r", token="t")
    for who in (ANYONE, somebody, holder):
        asked = Applicant("r", who=who)
        assert is_told(enter(asked)) == LANE
        assert is_told(enter(replace(asked, view="public"))) == LANE
    for who in (somebody, holder):
        assert is_told(enter(Applicant("r", "lab", who=who))) is None
    closed = Policy({"r": {S: Rule(), A: Rule(blackout=True)}})
    assert is_told(enter(Applicant("r", who=somebody), closed)) is None


def test_nobody_is_told_the_lane_for_another_reason_than_that_the_relay_is_full() -> None:
    asked = Applicant("r", who=ANYONE)
    assert enter(asked, occupancy=ROOM) is None
    assert enter(asked, occupancy=replace(NONE_LEFT, is_draining=True)) is DRAINING
    capped = Policy({"r": {A: Rule(viewers=2)}})
    assert enter(asked, capped, Occupancy(9, 10, 2)) is ROBOT_FULL
    assert is_told(enter(asked, capped, Occupancy(10, 10, 2))) is None  # nor would there be room otherwise
    assert is_told(enter(asked, capped, Occupancy(10, 10, 1))) == LANE
    without = admit(asked, BOTH)
    assert isinstance(without, Grant)
    assert find_no_room(without, NONE_LEFT) is FULL
    assert find_no_room(None, NONE_LEFT) is FULL


def test_a_crowded_address_is_let_in_only_to_be_told_the_lane() -> None:
    crowded = Applicant("r", is_crowded=True)
    found = admit(crowded, BOTH, has_past=True)
    assert found == replace(CROWDED, at_door=False, lane=LANE)
    assert admit(replace(crowded, shows_token=True, who=Close.TOKEN), BOTH, has_past=True) == found
    for other in (
        replace(crowded, view="lab"),
        replace(crowded, robot="none"),
        replace(crowded, bad_name="no name"),
    ):
        assert admit(other, BOTH, has_past=True) is CROWDED
    assert admit(replace(crowded, robot="R*", bad_name="no name"), Policy(), has_past=True) is CROWDED
    assert admit(crowded, BOTH) is CROWDED


def test_the_hub_tells_it_and_counts_whom_it_told() -> None:
    world = World(Limits(viewers=1))
    world.on_air()
    grant = admit(Applicant("r", who=ANYONE), BOTH, has_past=True)
    assert isinstance(grant, Grant)
    grants = [grant, replace(grant, lane=None), grant, replace(grant, lane=None), grant]
    screens = []
    for each in grants:
        screens.append(Screen())
        viewer = Viewer(screens[-1], "r", "public", 30.0, world.limits, world.now, grant=each)
        world.do(world.hub.join(viewer, world.now, UNIX_S))
    assert [screen.lane for screen in screens] == [None, None, LANE, None, LANE]
    assert (world.hub.sent_to_lane, world.hub.endings) == (2, {Close.FULL: 4})
    ((_, payload),) = split(messages.make_bye(1013, "full", 30.0, LANE))
    assert json.loads(payload) == {
        "type": "bye", "code": 1013, "reason": "full", "retry_s": 30.0, "lane": LANE
    }  # fmt: skip


def test_the_more_are_sent_to_the_lane_the_later_they_may_come_again() -> None:
    pace, now = RetryPace(), 0.0
    assert {pace.choose_retry_s(30.0, now) for _ in range(600)} == {30.0}
    told = [pace.choose_retry_s(30.0, now) for _ in range(4400)]  # 5,000 at once
    assert told == sorted(told)
    assert told[-1] == 250.0
    assert max(pace.choose_retry_s(30.0, now) for _ in range(100_000)) == 600.0
    assert pace.choose_retry_s(30.0, now + 3600.0) == 30.0
    # a crowd that comes again after one to two times as long: its tries grow with its root at most
    tries = {}
    for crowd in (1000, 16_000):
        pace = RetryPace()
        due = [(n / 1000, n) for n in range(crowd)]
        heapq.heapify(due)
        late = 0
        while due[0][0] < 1200.0:
            at, n = due[0]
            heapq.heapreplace(due, (at + pace.choose_retry_s(30.0, at) * (1 + n % 97 / 97), n))
            late += at >= 600.0
        tries[crowd] = late / 600.0
    assert tries[1000] <= 1000 / 40.0
    assert tries[16_000] <= 4 * tries[1000]


# ---- through real sockets -------------------------------------------------------


async def hear(relay: Relay, query: str = "", robot: str = "r", **headers: str) -> dict[str, Any]:
    """What a WebSocket is told last, and that it ends so."""
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    url = relay.url(robot, query)
    async with asyncio.timeout(10), websockets.connect(url, additional_headers=named, proxy=None) as socket:
        said: dict[str, Any] = {}
        try:
            async for message in socket:
                said = json.loads(message)
        except websockets.ConnectionClosed:
            pass
        assert socket.close_code == said["code"]
        return said


async def hear_events(relay: Relay, query: str = "", robot: str = "r", **headers: str) -> dict[str, Any]:
    """What an event stream is told, which is that it ends."""
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    async with httpx.AsyncClient(trust_env=False) as client:
        url = f"http://{relay.address}/api/v1/robots/{robot}/live.sse{query}"
        answer = await client.get(url, headers=named)
    assert (answer.status_code, answer.headers["content-type"]) == (200, "text/event-stream")
    assert answer.headers["access-control-allow-origin"] == "*"
    ((name, data),) = parse_events(answer.text)
    assert name == "bye"
    found: dict[str, Any] = json.loads(data)
    return found


def read_metric(port: int, name: str) -> float:
    """One figure."""
    found = re.search(rf"^{name} (\S+)$", httpx.get(f"http://127.0.0.1:{port}/metrics").text, re.MULTILINE)
    assert found, name
    return float(found[1])


async def test_a_relay_with_defaults_sends_whom_it_has_no_place_for_to_the_lane(
    relays: Any, edges: Any
) -> None:
    port = free_port()
    relay = relays("--max-viewers", "1", "--metrics-port", str(port))
    edge = edges(relay.zenoh)
    async with Watcher(relay.url()) as viewer:
        await viewer.until("frames", lambda v: v.frames)
        for query in ("", "?hz=5", "?format=json", "?view=public", "?auth=1"):
            told = await hear(relay, query)
            assert (told["code"], told["retry_s"], told["lane"]) == (Close.FULL, 30.0, LANE), query
            if query != "?auth=1":  # nobody can say anything there
                assert (await hear_events(relay, query)) == told
        assert (await hear(relay, "?view=lab"))["code"] == Close.FORBIDDEN

        def begin() -> dict[str, Any] | None:
            edge.force_key = True
            at = httpx.get(f"http://{relay.address}/api/v1/robots/r/past").json()["newest"]
            return at if isinstance(at, dict) else None

        at = await asyncio.to_thread(until, "a segment", begin, 15.0)
        address = httpx.URL(f"http://{relay.address}/api/v1/robots/r/live").join(told["lane"])
        answer = httpx.get(f"{address}/{at['take']}/{at['index']}")
        assert (answer.status_code, answer.headers["content-type"]) == (200, "application/octet-stream")
        assert viewer.closed is None
    assert await asyncio.to_thread(read_metric, port, "posecast_lane_viewers_total") == 9
    line = "full with 1 viewers (--max-viewers): more viewers of 'r' are sent to its"
    assert relay.errors().count(line) == 1


async def test_where_there_is_no_lane_the_log_says_why_once(relays: Any, tmp_path: Path) -> None:
    file = tmp_path / "robots.toml"
    file.write_text("[robots.r.anyone]\n[robots.slow.anyone]\nhz = 5\n[robots.late.anyone]\ndelay_s = 5\n")
    file.chmod(0o600)
    none = relays("--max-viewers", "1", "--past", "0")
    some = relays("--max-viewers", "1", "--robots", str(file))
    async with Watcher(none.url()), Watcher(some.url()):
        for _ in range(3):
            for relay, robot in ((none, "r"), (some, "slow"), (some, "late")):
                assert "lane" not in await hear(relay, robot=robot)
                assert "lane" not in await hear_events(relay, robot=robot)
        assert (await hear(some))["lane"] == LANE
    assert none.errors().count("are refused, without a lane, because this process keeps no past") == 1
    assert none.errors().count("without a lane") == 1
    for why in (NOT_ALL, DELAYED):
        assert some.errors().count(f"without a lane, because {why}") == 1


async def test_a_hall_behind_one_address_is_told_the_lane_and_takes_nobodys_place(relays: Any) -> None:
    relay = relays("--max-per-address", "1", "--trusted-proxies", "127.0.0.1")
    hall = {"X_Forwarded_For": "1.1.1.1"}
    url, sent = relay.url(), {"X-Forwarded-For": "1.1.1.1"}
    async with websockets.connect(url, additional_headers=sent, proxy=None) as first:
        await first.recv()
        for _ in range(3):
            for told in (await hear(relay, **hall), await hear_events(relay, **hall)):
                assert (told["code"], told["reason"]) == (Close.FULL, CROWDED.reason)
                assert (told["retry_s"], told["lane"]) == (30.0, LANE)
        with pytest.raises(websockets.InvalidStatus) as refused:
            await hear(relay, "?view=lab", **hall)
        assert refused.value.response.status_code == 503
        async with websockets.connect(
            relay.url(), additional_headers={"X-Forwarded-For": "2.2.2.2"}
        ) as other:
            await other.recv()
        await first.recv()


async def test_who_comes_again_and_again_while_it_is_full_leaves_nothing_behind(relays: Any) -> None:
    port = free_port()
    relay = relays("--max-viewers", "1", "--metrics-port", str(port))

    def measure() -> list[float]:
        names = ("posecast_tasks", "posecast_viewers", 'posecast_robots{state="offline"}')
        return [read_metric(port, re.escape(name)) for name in names]

    async with Watcher(relay.url()) as viewer:
        await viewer.until("it is in", lambda v: v.texts)
        before = await asyncio.to_thread(measure)
        for n in range(5):
            told = await asyncio.gather(*(hear(relay, robot=f"r{10 * n + k}") for k in range(10)))
            told += await asyncio.gather(*(hear_events(relay, robot=f"r{10 * n + k}") for k in range(10)))
            assert {each["lane"] for each in told} == {LANE}
        assert viewer.closed is None
    assert await asyncio.to_thread(read_metric, port, "posecast_lane_viewers_total") == 100

    def is_as_before() -> bool:
        return measure() == [before[0], 0, 0]

    await asyncio.to_thread(until, "nothing is left of them", is_as_before)
    assert relay.errors().count("full with 1 viewers") == 1
    assert httpx.get(f"http://{relay.address}/api/v1/robots").json() == {
        "robots": [],
        "publish_at": relay.zenoh,
    }
