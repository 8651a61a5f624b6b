"""Messages of several topics and publishers become one robot: time never flaps, the dead never look still."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import pairwise
from typing import Any

import pytest
from posecast_edge.sources.merge import LABELS_MAX, STATE_S, STREAM_S
from posecast_edge.sources.ros.merge import (
    HOLD_S,
    PUBLISHERS_MAX,
    SETTLE_S,
    SETTLED_S,
    TEXTS_MAX,
    MessageMerger,
    RobotClock,
)
from posecast_edge.sources.ros.messages import BATTERY, CONTROLLER_STATE, IMU, JOINT_STATE, Report

ARM = {"pos": {"arm": 1.0}}
LEG = {"pos": {"leg": 2.0}}


class Robot:
    """A Merge with a clock in the hand."""

    def __init__(self, settled: bool = True) -> None:
        self.said: list[str] = []
        self.merge = MessageMerger(settled, self.said.append)
        self.now_s = 100.0

    def pos(self, values: Any, stamp_s: float | None, topic: str = "/joint_states") -> None:
        self.merge.take_report(topic, "pos", JOINT_STATE, Report(stamp_s, values), self.now_s)

    def take(self, role: str, type_name: str, values: Any, stamp_s: float | None, topic: str = "") -> None:
        self.merge.take_report(topic or f"/{role}", role, type_name, Report(stamp_s, values), self.now_s)

    def values(self) -> Any:
        sample = self.merge.make_sample(self.now_s)
        return None if sample is None else sample.values

    def t_s(self) -> float | None:
        sample = self.merge.make_sample(self.now_s)
        return None if sample is None else sample.t_s


def test_two_publishers_of_one_topic_are_one_robot() -> None:
    robot = Robot()
    robot.pos(ARM, 1.0)
    robot.pos(LEG, 1.01)
    assert robot.values() == {"pos": {"arm": 1.0, "leg": 2.0}}
    robot.pos({"pos": {"arm": 1.5}}, 1.02)
    assert robot.values() == {"pos": {"arm": 1.5, "leg": 2.0}}
    assert robot.values() is None  # nothing new


def test_a_publisher_that_dies_takes_its_readings_with_it() -> None:
    robot = Robot()
    robot.pos(LEG, 1.0)
    for k in range(16):
        robot.now_s += STREAM_S / 15
        robot.pos(ARM, 1.1 + k)
    assert robot.values() == {"pos": {"arm": 1.0}}


def test_what_is_told_rarely_lasts_longer() -> None:
    robot = Robot()
    robot.take("battery", BATTERY, {"volt": {"main": 48.0}}, 1.0)
    robot.take("ref", JOINT_STATE, {"ref": {"arm": 0.5}}, 1.0)  # a command stands until the next
    robot.take(
        "ref", CONTROLLER_STATE, {"ref": {"leg": 0.5}}, 1.0, "/state"
    )  # a controller speaks all the time
    robot.now_s += STATE_S - 1
    robot.pos(ARM, 60.0)
    assert robot.values() == {"volt": {"main": 48.0}, "ref": {"arm": 0.5}, **ARM}
    robot.now_s += 2
    robot.pos(ARM, 62.0)
    assert robot.values() == ARM


def test_positions_make_samples_and_the_rest_goes_with_them() -> None:
    robot = Robot()
    robot.take("imu", IMU, {"acc": {"a.z": 9.8}}, 1.0)
    assert robot.t_s() is None  # positions may yet come
    robot.now_s += STREAM_S
    robot.take("imu", IMU, {"acc": {"a.z": 9.8}}, 1.0)
    assert robot.t_s() == 1.0  # they do not: the IMU speaks for the robot
    robot.pos(ARM, 1.1)
    assert robot.t_s() == 1.1
    robot.take("imu", IMU, {"acc": {"a.z": 9.7}}, 1.2)
    assert robot.values() is None
    robot.pos(ARM, 1.3)
    assert robot.values() == {"acc": {"a.z": 9.7}, **ARM}
    robot.now_s += STREAM_S
    robot.take("imu", IMU, {"acc": {"a.z": 9.6}}, 3.0)
    assert robot.values() == {"acc": {"a.z": 9.6}}  # the joints are gone, the robot is not


def test_of_two_topics_with_one_channel_the_first_name_counts_whatever_comes_last() -> None:
    robot = Robot()
    robot.take("imu", IMU, {"quat": {"a.w": None}}, 1.0, "/imu/data_raw")
    robot.take("imu", IMU, {"quat": {"a.w": 0.9}}, 1.0, "/imu/data")
    robot.take("imu", IMU, {"quat": {"a.w": None}}, 1.1, "/imu/data_raw")
    robot.pos(ARM, 1.2)
    assert robot.values() == {"quat": {"a.w": 0.9}, **ARM}
    assert robot.said == [
        "quat of 'a.w' is on /imu/data and /imu/data_raw: the first is used; "
        "to choose another, set it in a profile's [ros]"
    ]


def test_without_a_profile_the_first_sample_waits_for_all_there_is() -> None:
    robot = Robot(settled=False)
    robot.merge.expect_topic("/joint_states")
    robot.merge.expect_topic("/battery")
    robot.pos(ARM, 1.0)
    assert robot.values() is None
    robot.now_s += SETTLED_S
    assert robot.values() is None  # the battery has not spoken
    robot.take("battery", BATTERY, {"volt": {"main": 48.0}}, 1.0)
    assert robot.values() == {"volt": {"main": 48.0}, **ARM}


def test_but_not_for_ever() -> None:
    robot = Robot(settled=False)
    robot.merge.expect_topic("/never")
    robot.pos(ARM, 1.0)
    assert robot.values() is None
    robot.now_s += SETTLE_S
    robot.pos(ARM, 1.5)
    assert robot.values() == ARM


def test_publishers_without_end_do_not_fill_the_memory() -> None:
    robot = Robot()
    for k in range(PUBLISHERS_MAX + 50):
        robot.pos({"pos": {f"j{k}": 0.0}}, k + 1.0)
    values = robot.values()
    assert len(values["pos"]) == PUBLISHERS_MAX
    assert f"j{PUBLISHERS_MAX + 49}" in values["pos"]


def test_a_publisher_that_goes_on_for_long_takes_nothing_from_the_others() -> None:
    robot = Robot()
    robot.pos(LEG, 0.5)
    arms = {"pos": {f"arm{k}": 0.0 for k in range(1000)}}
    for k in range(2 * LABELS_MAX // 1000):
        robot.pos(arms, k + 1.0)
    assert robot.values() == {"pos": LEG["pos"] | arms["pos"]}


def test_publishers_that_go_make_room_for_others() -> None:
    robot = Robot()
    for k in range(40):
        robot.pos({"pos": {f"arm{k}.{i}": 0.0 for i in range(1000)}}, k + 1.0)
    assert len(robot.values()["pos"]) == LABELS_MAX // 1000 * 1000


def test_time_that_stands_still_is_silence_and_noticed() -> None:
    robot = Robot()
    robot.pos(ARM, 1.0)
    assert robot.t_s() == 1.0
    for _ in range(10):
        robot.now_s += 0.5
        robot.pos(ARM, 1.0)
        assert robot.t_s() is None
    assert robot.merge.stands_since_s == pytest.approx(100.5)
    robot.pos(ARM, 1.01)
    assert robot.t_s() == 1.01
    assert robot.merge.stands_since_s is None


def run_clock(
    messages: Iterable[tuple[float, str, float | None]],
) -> tuple[list[tuple[float, float]], list[str]]:
    """Robot time after each message that advanced it, with its arrival, and what was said. `messages`:
    arrival, publisher, stamp."""
    said: list[str] = []
    clock = RobotClock(said.append)
    times = [
        (now_s, clock.t_s)
        for now_s, publisher, stamp_s in messages
        if clock.advance((f"/{publisher}", "j", 1), stamp_s, now_s)
    ]
    return times, said


def publish(
    name: str, hz: float, stamp: Callable[[float], float | None], seconds: float = 12.0, began_s: float = 0.0
) -> list[tuple[float, str, float | None]]:
    """Messages that one publisher sends: `stamp` makes the timestamp of the time that has passed."""
    return [(began_s + k / hz, name, stamp(began_s + k / hz)) for k in range(round((seconds - began_s) * hz))]


WALL, SIM = 1_795_874_494.0, 12.0
OTHER_CLOCKS: dict[str, Callable[[float], float | None]] = {
    "wall": lambda t: WALL + t,
    "simulated": lambda t: SIM + t,
    "slow": lambda t: SIM + t / 3,
    "in a loop": lambda t: 100 + t % 3,
    "of another computer": lambda t: WALL - 5 + t,
    "none": lambda _: None,
    "standing": lambda _: 7.0,
}


@pytest.mark.parametrize("hz", [0.5, 1.0, 5.0, 15.0])
@pytest.mark.parametrize("other", OTHER_CLOCKS)
@pytest.mark.parametrize("late", [False, True])
def test_two_clocks_never_mix(other: str, hz: float, late: bool) -> None:
    """An arm at 50 Hz has simulated time. A gripper with another clock speaks first, or later."""
    arm = publish("arm", 50, lambda t: SIM + t, began_s=0.0 if late else 0.1)
    gripper = publish("gripper", hz, OTHER_CLOCKS[other], began_s=2.0 if late else 0.0)
    times, said = run_clock(sorted(arm + gripper))
    steps = [(a, b) for a, b in pairwise(times) if not 0 < b[1] - a[1] < 1]
    assert len(steps) <= (0 if late else 1), "at most one change of the clock, at the start"
    after = [(now_s, t_s) for now_s, t_s in times if now_s >= 2]
    apart = {now_s - t_s for now_s, t_s in after}
    assert max(apart) - min(apart) < 0.1, "robot time is the arm's"
    assert len(after) > 450, "it goes on at 50 Hz"
    if other in ("wall", "of another computer"):
        assert len(said) == 1
        assert said[0].startswith("two clocks: the timestamps of /gripper ('j') are ")
        assert said[0].endswith("those of /arm ('j'), which are used; is use_sim_time the same for both?")
    elif other == "none":
        assert said == []


@pytest.mark.parametrize("hz", [5.0, 20.0, 50.0])
@pytest.mark.parametrize("loop_s", [0.4, 2.0, 3.0, 60.0])
@pytest.mark.parametrize("joint_publishers", [1, 2])
def test_a_loop_does_not_stand_still(hz: float, loop_s: float, joint_publishers: int) -> None:
    messages = sorted(
        message
        for k in range(joint_publishers)
        for message in publish(f"p{k}", hz, lambda t: 100 + t % loop_s, began_s=k * 0.004, seconds=130)
    )
    times, said = run_clock(messages)
    assert (
        max(b - a for (a, _), (b, _) in pairwise(times)) < max(2.5 / hz, HOLD_S + 1 / hz) + 0.02
        if loop_s * hz < 3
        else 2.5 / hz + 0.02
    )
    assert said == []


STRAYS = [
    (3600.0, 1),
    (-3600.0, 1),
    (5.0, 1),
    (-5.0, 1),
    (-0.001, 1),
    (1e9, 1),
    (-11.0, 1),
    (0.0, 1),
    (30.0, 1),
    (-1.0, 1),
]


@pytest.mark.parametrize(("by_s", "count"), STRAYS)
def test_a_stray_timestamp_costs_one_message(by_s: float, count: int) -> None:
    stamps = [SIM + k / 20 + (by_s if k == 30 else 0.0) for k in range(100)]
    times, _ = run_clock((k / 20, "arm", stamp) for k, stamp in enumerate(stamps))
    assert [t for _, t in times] == sorted(t for _, t in times)
    assert len(times) >= 99


@pytest.mark.parametrize("by_s", [-3600.0, -49.0, -1.0, -0.2, 5.0, 3600.0, WALL])
@pytest.mark.parametrize("hz", [0.2, 1.0, 20.0, 1000.0])
def test_a_clock_that_is_set_is_followed_from_the_second_message_on(hz: float, by_s: float) -> None:
    count = 40
    stamps = [5000 + k / hz + (by_s if k >= count // 2 else 0.0) for k in range(count)]
    times, said = run_clock((k / hz, "arm", stamp) for k, stamp in enumerate(stamps))
    assert len(times) >= count - 1
    assert times[-1][1] == pytest.approx(stamps[-1])
    assert said == []


def test_a_publisher_that_dies_hands_on_its_lead() -> None:
    """The one that stays has another clock; or the same one, and nothing is said."""
    for ahead_s, lines in ((WALL, 1), (SIM, 0)):

        def stamp(t: float, ahead_s: float = ahead_s) -> float:
            return ahead_s + t

        arm = publish("arm", 50, lambda t: SIM + t, seconds=5)
        times, said = run_clock(sorted(arm + publish("gripper", 5, stamp)))
        assert times[-1][1] == pytest.approx(stamp(times[-1][0]))
        assert len([t for t, _ in times if t > 5]) > 30
        assert len(said) == lines


@pytest.mark.parametrize("hz", [0.1, 0.3, 0.7, 1.0, 10.0])
@pytest.mark.parametrize("other_hz", [0.1, 0.3, 0.7, 1.0, 10.0])
def test_two_slow_clocks_do_not_alternate(hz: float, other_hz: float) -> None:
    messages = publish("arm", hz, lambda t: SIM + t, 100) + publish(
        "gripper", other_hz, lambda t: WALL + t, 100, 0.3
    )
    times, said = run_clock(sorted(messages))
    assert len([b for a, b in pairwise(times) if not -1 < b[1] - a[1] < 20]) <= 1
    assert len(times) > 0.8 * 100 * max(hz, other_hz) / 2
    assert len(said) == 1


def test_publishers_of_clocks_without_end_do_not_fill_the_memory() -> None:
    clock = RobotClock(lambda _: None)
    for k in range(3 * PUBLISHERS_MAX):
        clock.advance(("/t", f"j{k}", 1), k / 100, k / 100)
    assert len(clock._publishers) == PUBLISHERS_MAX
    assert clock.t_s == (3 * PUBLISHERS_MAX - 1) / 100


def test_two_nodes_with_the_same_joints_and_other_clocks_do_not_make_time_flap() -> None:
    for hz, other_hz in ((100, 100), (100, 10), (10, 100)):
        messages = sorted(
            publish("arm", hz, lambda t: 1000 + t)
            + publish("arm", other_hz, lambda t: 995 + t, began_s=0.003)
            + publish("arm", 10, lambda _: None, began_s=0.005)
        )
        times, _ = run_clock(messages)
        back = [(a, b) for (_, a), (_, b) in pairwise(times) if b < a]
        assert len(back) <= 1
        assert len(times) > 100


def test_without_stamps_time_is_that_of_arrival() -> None:
    times, said = run_clock([(7.0, "arm", None), (7.1, "arm", None), (7.1 + HOLD_S, "arm", 3.0)])
    assert [t for _, t in times] == [7.0, 7.1, 3.0]  # now somebody has a clock
    assert said == []


def test_texts_without_end_do_not_fill_the_memory() -> None:
    robot = Robot()
    robot.merge.take_report("/d", "diagnostics", "", Report(1.0, {}, {"motor": "hot"}), robot.now_s)
    for k in range(2 * TEXTS_MAX):
        robot.merge.take_report("/d", "diagnostics", "", Report(1.0, {}, {f"name{k}": "x"}), robot.now_s)
    robot.merge.take_report("/d", "diagnostics", "", Report(1.0, {}, {"motor": "well"}), robot.now_s)
    robot.pos(ARM, 1.0)
    sample = robot.merge.make_sample(robot.now_s)
    assert sample is not None
    assert (len(sample.info), sample.info["motor"]) == (TEXTS_MAX, "well")
