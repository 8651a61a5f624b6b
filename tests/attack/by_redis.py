"""What is sent and asked where an ingest and a gateway meet in Redis."""

from __future__ import annotations

import hashlib
import itertools

from tests.attack.by_frames import AS_FAST_AS_IT_GOES, Ready
from tests.attack.by_viewers import asked_for_nobody
from tests.attack.by_words import EVENT
from tests.attack.hostile_robot import Robot
from tests.attack.target import Steps, Target, attack


@attack(behind_redis=True)
def flood_through_redis(at: Target) -> Steps:
    """frames, events, texts and models of one robot at full speed, through Redis to a gateway"""
    robot = Robot(at).on_air()
    ready = Ready(robot)
    ready.begin()
    n = itertools.count()
    yield

    def send() -> None:
        count = next(n)
        ready.put()
        if count % 5 == 0:
            robot.tell(EVENT | {"text": "x" * 1000})
        if count % 50 == 0:
            robot.tell({"type": "info", "kv": {"n": f"{count}{'x' * 1900}"}})
            robot.tell({"type": "model", "hash": hashlib.sha256(str(count).encode()).hexdigest()})

    return at.paced(AS_FAST_AS_IT_GOES, send)


@attack(behind_redis=True)
def names_of_nobody_at_a_gateway(at: Target) -> Steps:
    """viewers of a gateway that request absent robots and views, at full speed"""
    return (yield from asked_for_nobody(at))
