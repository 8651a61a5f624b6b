"""A new policy reaches all viewers, some in each turn of the loop, so that nobody's frames wait for it."""

from __future__ import annotations

import asyncio
import itertools

import pytest
from posecast_relay.auth import access
from posecast_relay.auth.access import open_access
from posecast_relay.core.delayed import DelayedHub
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.core.policy import ANYONE, Applicant, Audience, Grant, Policy, Refusal, Rule
from posecast_relay.core.viewer import Viewer
from posecast_relay.runtime.dispatcher import MemoryStore
from posecast_relay.runtime.fan_out import FanOut

from .sim import Edge, Screen, schema

VIEWERS = 5 * access.REJUDGED_AT_ONCE + 7
ROBOT = "r"


def policy(hz: float) -> Policy:
    """Everybody may see the robot, at this rate."""
    return Policy({ROBOT: {Audience.ANYONE: Rule(hz=hz)}})


class Hall:
    """Viewers of one robot. Counts whom the access control judges."""

    def __init__(self) -> None:
        limits = Limits(viewers=VIEWERS)
        self.access = open_access(
            *(Hub(limits), DelayedHub(limits), MemoryStore(), FanOut(None)), policy=policy(30)
        )
        self.hub = self.access.live.hub
        live, now = self.access.live, self.access.live.now()
        edge = Edge(0xE, schema(), began_s=now)
        live.carry_out(self.hub.set_token(ROBOT, True, now))
        self.hub.receive_frame(ROBOT, "public", edge.frame(now, force_key=True), edge.stamp(now), now)
        self.hub.take_snapshot(ROBOT, "public", edge.snapshot(), edge.stamp(now), now)
        admit = self.access.admit
        grant = admit(Applicant(ROBOT, None, who=ANYONE))
        assert isinstance(grant, Grant)
        for _ in range(VIEWERS):
            live.join(Viewer(Screen(), ROBOT, grant.view, 30.0, limits, now, 1e9, grant=grant))
        self.judged = 0

        def count(applicant: Applicant) -> Grant | Refusal:
            self.judged += 1
            return admit(applicant)

        self.access.admit = count  # type: ignore[method-assign]

    def rates(self) -> list[float]:
        """The rate of each viewer's grant, in the order in which they came."""
        return [viewer.grant.hz for viewer in self.hub.viewers if viewer.grant is not None]


async def until_applied(hall: Hall) -> list[int]:
    """Wait until the policy is applied to all; how many were judged at first and in each turn."""
    judged = [0, hall.judged]
    while hall.rates().count(hall.rates()[-1]) < VIEWERS or judged[-1] != judged[-2]:
        await asyncio.sleep(0)
        judged.append(hall.judged)
        assert len(judged) < 1000, "it does not end"
    return [after - before for before, after in itertools.pairwise(judged)]


async def test_a_policy_is_applied_to_some_viewers_in_each_turn_and_to_all_in_the_end() -> None:
    hall = Hall()
    hall.access.set_policy(policy(10))
    turns = await until_applied(hall)
    assert max(turns) == access.REJUDGED_AT_ONCE
    assert sum(turns) == VIEWERS
    assert set(hall.rates()) == {10}


async def test_a_newer_policy_replaces_one_that_is_still_being_applied() -> None:
    hall = Hall()
    for hz in (10, 20, 5):
        hall.access.set_policy(policy(hz))
        await asyncio.sleep(0)
        assert set(hall.rates()) > {hz}
    turns = await until_applied(hall)
    assert set(hall.rates()) == {5}
    assert hall.judged <= VIEWERS + 4 * access.REJUDGED_AT_ONCE
    assert max(turns[1:]) == access.REJUDGED_AT_ONCE


@pytest.mark.parametrize("hz", [None, 10])
async def test_who_leaves_and_who_comes_meanwhile_are_no_trouble(hz: float | None) -> None:
    hall = Hall()
    hub = hall.hub
    hall.access.set_policy(Policy({}) if hz is None else policy(hz))
    for viewer in list(hub.viewers)[-50:]:
        hub.remove_viewer(viewer)
    for _ in range(20):
        await asyncio.sleep(0)
    assert len(hub.viewers) == (0 if hz is None else VIEWERS - 50)
    assert set(hall.rates()) <= {hz}
    assert not hall.access.live.faults
