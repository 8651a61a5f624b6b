"""Decoding for those who ask: no robot's channels cost the others their frames. The clock is passed in."""

from __future__ import annotations

import json

from posecast_relay.http.robots import StateReader
from posecast_relay.kit import CREDIT_S
from posecast_relay.net.encodings import CHANNELS_PER_S, ROBOT_CHANNELS_PER_S, DecodeCache
from posecast_wire import Schema, build_schema_text

from .sim import World


def wide(channels: int) -> Schema:
    """A schema of so many."""
    fields: list[dict[str, object]] = [{"name": "pos", "labels": "joint", "unit": "rad", "scale": 0.001}]
    return Schema.parse(build_schema_text("sim", {"joint": [f"j{n}" for n in range(channels)]}, fields))


def decoded_in(
    world: World, decoded: DecodeCache, channels: int, robots: int, seconds: float
) -> dict[str, int]:
    """Frames at 60 Hz of robots that are all asked for: how many were decoded of each."""
    edges = {f"r{n}": world.on_air(wide(channels), robot=f"r{n}") for n in range(robots)}
    found = dict.fromkeys(edges, 0)
    for _ in range(round(60 * seconds)):
        world.pass_time(1 / 60)
        for name, edge in edges.items():
            world.publish(edge, robot=name)
            found[name] += decoded.make_text(world.hub.robots[name].rooms["public"].stream) is not None
    return found


def test_a_humanoid_is_decoded_at_every_rate() -> None:
    world = World()
    assert decoded_in(world, DecodeCache(lambda: world.now), 244, 1, 2.0)["r0"] == 120


def test_a_robot_of_many_channels_has_its_share() -> None:
    world = World()
    found = decoded_in(world, DecodeCache(lambda: world.now), 4096, 1, 4.0)["r0"]
    most = ROBOT_CHANNELS_PER_S * (4.0 + CREDIT_S) / 4096
    assert 0.7 * most - 3 <= found <= most + 1


def test_many_of_them_share_what_there_is() -> None:
    world = World()
    found = decoded_in(world, DecodeCache(lambda: world.now), 2000, 10, 4.0)
    each = CHANNELS_PER_S / 10 * 4.0 / 2000
    assert sum(found.values()) <= 1.3 * 10 * each
    assert min(found.values()) >= 0.6 * each


def test_a_state_that_was_not_decoded_anew_says_how_old_it_is() -> None:
    world = World()
    edge = world.on_air(wide(4096))
    reader = StateReader(lambda: world.now, DecodeCache(lambda: world.now))
    robot = world.hub.robots["r"]
    ages, seqs = set[int](), set[int]()
    for _ in range(60):
        world.pass_time(1 / 60)
        world.publish(edge)
        doc = json.loads(reader.read(robot, robot.rooms["public"], 60.0))
        assert set(doc) == {"robot", "view", "status", "age_ms", "info", "seq", "t", "fields"}
        assert (edge.seq - doc["seq"]) * 1000 / 60 <= doc["age_ms"] + 1
        ages.add(doc["age_ms"])
        seqs.add(doc["seq"])
    assert len(seqs) < 20
    assert max(ages) >= 100


def test_a_document_with_half_a_character_is_an_answer() -> None:
    world = World()
    world.on_air(wide(2))
    robot = world.hub.robots["r"]
    robot.rooms["public"].stream.info = {"name": "\ud800"}
    body = StateReader(lambda: world.now, DecodeCache(lambda: world.now)).read(
        robot, robot.rooms["public"], 60.0
    )
    assert json.loads(body)["info"] == {"name": "?"}
