"""When /tf tells the joints and when joint states do; in what the samples then have."""

from __future__ import annotations

from typing import Any

from posecast_edge.model.moving_joints import MovingJoint
from posecast_edge.profile.reader import parse_profile
from posecast_edge.sources.ros.merge import SETTLE_S, MessageMerger
from posecast_edge.sources.ros.messages import JOINT_STATE, Report
from posecast_edge.sources.ros.robot_frames import STATES_S, RobotFrames

LEVEL = (1.0, 0.0, 0.0, 0.0)
ARM = tuple(
    MovingJoint(name, True, parent, child, (0, 0, 0), LEVEL, (1, 0, 0))
    for name, parent, child in [("low", "base", "mid"), ("high", "mid", "top")]
)


def moved(child: str, parent: str, metres: float, stamp_s: int) -> dict[str, Any]:
    return {
        "header": {"stamp": {"sec": stamp_s, "nanosec": 0}, "frame_id": parent},
        "child_frame_id": child,
        "transform": {
            "translation": {"x": metres, "y": 0.0, "z": 0.0},
            "rotation": dict(zip("wxyz", LEVEL, strict=True)),
        },
    }


def low(metres: float, stamp_s: int) -> dict[str, Any]:
    return {"transforms": [moved("mid", "base", metres, stamp_s)]}


class Stage:
    def __init__(self, settled: bool = True, profile: str | None = None) -> None:
        self.said: list[str] = []
        self.merge = MessageMerger(settled, self.said.append)
        self.frames = RobotFrames(parse_profile(profile) if profile else None, self.merge, self.said.append)
        self.frames.joints.set_joints(ARM)

    def tf(self, message: Any, now_s: float) -> Any:
        if self.frames.needs_messages(now_s):
            self.frames.take_message(message, False, now_s)
        sample = self.merge.make_sample(now_s)
        return sample and sample.values["pos"]

    def state(self, now_s: float, stamp_s: float, **positions: float) -> Any:
        report = Report(stamp_s, {"pos": positions})
        self.frames.note_report("pos", report)
        self.merge.take_report("/joint_states", "pos", JOINT_STATE, report, now_s)
        sample = self.merge.make_sample(now_s)
        return sample and sample.values["pos"]


def test_all_joints_are_channels_whichever_transform_comes_first() -> None:
    stage = Stage()
    assert stage.tf(low(0.1, 1), 1.0) == {"low": 0.1, "high": None}
    high = {"transforms": [moved("top", "mid", 0.2, 2)]}
    assert stage.tf(high, 1.1) == {"low": 0.1, "high": 0.2}
    assert stage.tf(low(0.3, 3), 1.2) == {"low": 0.3, "high": 0.2}
    assert stage.tf(low(0.4, 4), 2.7) == {"low": 0.4, "high": None}  # what is silent has no reading


def test_joint_states_win_from_the_first_on() -> None:
    stage = Stage()
    assert stage.tf(low(0.1, 1), 1.0) == {"low": 0.1, "high": None}
    stage.frames.note_report("pos", Report(1.5, {"vel": {"low": 0.0}}))  # says no position
    assert stage.tf(low(0.2, 2), 1.1) == {"low": 0.2, "high": None}
    report = Report(2.5, {"pos": {"low": 5.0, "grip": 0.5}})
    stage.frames.note_report("pos", report)
    stage.merge.take_report("/joint_states", "pos", JOINT_STATE, report, 1.2)
    sample = stage.merge.make_sample(1.2)
    assert sample is not None
    assert sample.values["pos"] == {"low": 5.0, "grip": 0.5}
    assert not stage.frames.needs_messages(1.3)
    assert stage.tf(low(0.3, 3), 1.3) is None
    assert stage.state(9.0, 4.0, low=6.0) == {"low": 6.0}
    assert stage.said == []


def test_a_topic_of_joint_states_is_waited_for() -> None:
    stage = Stage()
    stage.frames.expect_states()
    assert stage.tf(low(0.1, 1), 1.0) is None
    assert stage.tf(low(0.2, 2), 0.9 + STATES_S) is None
    assert stage.tf(low(0.3, 3), 1.0 + STATES_S) == {"low": 0.3, "high": None}


def test_joints_whose_model_comes_late_are_announced() -> None:
    stage = Stage()
    assert stage.frames.take_message(low(0.1, 1), False, 1.0)
    first = stage.merge.make_sample(1.0)
    stage.frames.take_message(low(0.2, 2), False, 1.1)
    second = stage.merge.make_sample(1.1)
    assert first is not None
    assert second is not None
    assert [*first.values["pos"]] == [*second.values["pos"]] == ["low", "high"]
    stage.frames.joints.set_joints(
        (*ARM, MovingJoint("more", True, "top", "tip", (0, 0, 0), LEVEL, (1, 0, 0)))
    )
    stage.frames.take_message(low(0.3, 3), False, 1.2)
    third = stage.merge.make_sample(1.2)
    assert third is not None
    assert third.values["pos"] == {"low": 0.3, "high": None, "more": None}


def test_without_a_profile_the_first_sample_comes_as_soon_as_with_joint_states() -> None:
    stage = Stage(settled=False)
    assert [stage.tf(low(0.1, k), k / 10) is not None for k in range(1, 10)].index(True) < SETTLE_S * 10 / 2


def test_a_profile_without_positions_wants_none() -> None:
    stage = Stage(profile='[labels]\nsite = ["a"]\n[[fields]]\nname = "volt"\nlabels = "site"\n')
    assert not stage.frames.needs_messages(9.0)
    stage.frames.watch()
    assert stage.tf(low(0.1, 1), 9.0) is None
    stage.frames.check_time(99.0)
    assert stage.said == []


def test_of_a_profile_only_its_joints_are_read() -> None:
    stage = Stage(profile='[labels]\njoint = ["high", "x"]\n[[fields]]\nname = "pos"\n')
    both = {"transforms": [*low(0.1, 1)["transforms"], moved("top", "mid", 0.2, 1)]}
    assert stage.tf(both, 1.0) == {"high": 0.2}
    assert stage.said == []
    stage = Stage(profile='[labels]\njoint = ["x"]\n[[fields]]\nname = "pos"\n')
    assert stage.tf(both, 1.0) is None
    stage.frames.check_time(99.0)
    assert stage.said == ["joints are not read from /tf: the profile's pos has none of the model's joints"]


def test_what_probe_shows() -> None:
    stage = Stage()
    assert stage.frames.list_lines() == []
    stage.tf(low(0.1, 1), 1.0)
    line = "joints from /tf: 1 of 2; no transform for high (mid → top)"
    assert line in stage.frames.list_lines()
    stage.state(1.2, 2.5, low=5.0)
    assert line not in stage.frames.list_lines()
