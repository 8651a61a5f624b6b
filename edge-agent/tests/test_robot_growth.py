"""`posecast.Robot` against a real router: what a program begins to publish later appears."""

from __future__ import annotations

import itertools

import posecast
from edge_stage import ROBOT, Router
from posecast_testing import until
from test_robot import Watched, publish_until

POS = {"elbow": 0.4}


def count_schemas(router: Router) -> int:
    ids = (frame.header.schema_id for frame in list(router.frames))
    return len({schema_id for schema_id in ids if schema_id is not None})


def test_a_field_and_a_joint_that_come_later_appear(router: Router) -> None:
    watched = Watched(router)
    with posecast.Robot(ROBOT, relay=router.endpoint) as robot:
        publish_until(robot, lambda: watched.sees(pos=POS), pos=POS)
        later = {"pos": {"elbow": 0.5, "wrist": 0.25}, "effort": {"elbow": 2.0}}
        both = {"elbow": 2.0, "wrist": None}
        publish_until(robot, lambda: watched.sees(pos=later["pos"], effort=both), **later)
        assert robot.status().problems == {}
    assert count_schemas(router) == 2


def test_a_bit_that_comes_later_appears(router: Router) -> None:
    """Until then nothing is said of it: it isn't among the robot's bits."""
    watched = Watched(router)
    with posecast.Robot(ROBOT, relay=router.endpoint) as robot:
        flags: dict[str, list[str]] = {"elbow": ["jam"], "wrist": []}
        publish_until(robot, lambda: watched.sees(flags={"elbow": 1, "wrist": 0}), pos=POS, flags=flags)
        assert "homed" not in watched.bits
        flags = {"elbow": ["jam", "homed"], "wrist": ["odd"]}
        publish_until(robot, lambda: bool(watched.look()) and "homed" in watched.bits, pos=POS, flags=flags)
        homed, odd = (1 << watched.bits.index(bit) for bit in ("homed", "odd"))
        publish_until(
            robot, lambda: watched.sees(flags={"elbow": 1 + homed, "wrist": odd}), pos=POS, flags=flags
        )
        until("the new fault is an event", lambda: any(e["text"] == "odd" for e in router.events))
        assert robot.status().problems == {}
    assert count_schemas(router) == 2


def test_a_fault_of_a_new_name_between_two_frames_is_an_event(router: Router) -> None:
    watched = Watched(router)
    with posecast.Robot(ROBOT, relay=router.endpoint) as robot:
        publish_until(robot, lambda: watched.sees(pos=POS), pos=POS, flags={"elbow": []})
        robot.publish(pos=POS, flags={"elbow": ["odd"]})
        robot.publish(pos=POS, flags={"elbow": []})
        until("both", lambda: [e["state"] for e in router.events if e["text"] == "odd"] == ["on", "off"])


def test_a_fault_that_lasts_is_not_told_again_when_more_comes(router: Router) -> None:
    watched, flags = Watched(router), {"elbow": ["jam"]}
    with posecast.Robot(ROBOT, relay=router.endpoint) as robot:
        publish_until(robot, lambda: watched.sees(pos=POS), pos=POS, flags=flags)
        both = {"elbow": ["jam"], "wrist": ["hot"]}
        until_told = [("elbow", "jam", "on"), ("wrist", "hot", "on"), ("elbow", "jam", "off")]

        def told() -> list[tuple[str, str, str]]:
            return [(str(e["source"]), str(e["text"]), str(e["state"])) for e in router.events]

        publish_until(robot, lambda: told() == until_told[:2], pos=POS, flags=both)
        publish_until(robot, lambda: len(told()) > 2, pos=POS, flags={"elbow": [], "wrist": ["hot"]})
        assert told() == until_told


def test_joints_of_the_constructor_get_a_field_more(router: Router) -> None:
    watched = Watched(router)
    with posecast.Robot(ROBOT, relay=router.endpoint, joints=["elbow", "wrist"]) as robot:
        publish_until(robot, lambda: "pos" in watched.look(), pos=[0.4, 0.5])
        publish_until(robot, lambda: watched.sees(temp={"elbow": 40.0, "wrist": 41.0}), temp=[40, 41])
        assert list(watched.newest["pos"]) == ["elbow", "wrist"]
        assert robot.status().problems == {}


def test_names_that_are_made_up_for_ever_do_not_stop_the_rest(router: Router) -> None:
    watched, numbers = Watched(router), itertools.count()
    with posecast.Robot(ROBOT, relay=router.endpoint) as robot:
        publish_until(robot, lambda: watched.sees(pos=POS), pos=POS)

        def go_on() -> bool:
            robot.publish(pos={"elbow": 0.7}, volt={f"v{next(numbers)}": 1.0})
            return watched.sees(pos={"elbow": 0.7}) and count_schemas(router) > 1

        until("it goes on", go_on)
        assert count_schemas(router) <= 1 + next(numbers) / 10  # not one for each call
