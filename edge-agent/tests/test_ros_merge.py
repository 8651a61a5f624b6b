"""Messages of several topics and publishers become one robot: time never flaps, the dead never look still."""

from __future__ import annotations

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


def test_a_clock_steps_back_once_when_a_simulation_begins_anew() -> None:
    clock = RobotClock()
    assert clock.advance(50.0, 0.0)
    assert not clock.advance(1.0, 0.1)
    assert clock.advance(1.1, HOLD_S)
    assert clock.advance(1.2, HOLD_S + 0.01)
    assert clock.t_s == 1.2


def test_two_computers_whose_clocks_differ_do_not_make_time_flap() -> None:
    clock = RobotClock()
    times = []
    for k in range(100):
        now_s = k / 100
        clock.advance(1000 + now_s, now_s)
        times.append(clock.t_s)
        clock.advance(995 + now_s, now_s)  # five seconds behind
        clock.advance(None, now_s)  # and one without a clock
        times.append(clock.t_s)
    assert times == sorted(times)
    assert times[-1] == pytest.approx(1000.99)


def test_without_stamps_time_is_that_of_arrival() -> None:
    clock = RobotClock()
    assert clock.advance(None, 7.0)
    assert clock.advance(None, 7.1)
    assert clock.t_s == 7.1
    assert clock.advance(3.0, 7.1 + HOLD_S)  # now somebody has a clock
    assert clock.t_s == 3.0


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
