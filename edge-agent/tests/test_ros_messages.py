"""ROS messages become fields, whichever of two forms they come in; what is wrong is named, never guessed."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from posecast_edge.sources.ros.messages import (
    BATTERY,
    CONTROLLER_STATE,
    DIAGNOSTICS,
    IMU,
    JOINT_STATE,
    MAX_STATUSES,
    ODOMETRY,
    WRENCH,
    Report,
    RosMessageError,
    get_text,
    read_message,
    read_transforms,
    shorten_type,
)

ROS_2 = {"stamp": {"sec": 5, "nanosec": 250_000_000}, "frame_id": "pelvis"}
ROS_1 = {"seq": 7, "stamp": {"secs": 5, "nsecs": 250_000_000}, "frame_id": "/torso/imu.link"}
ZERO = {"x": 0.0, "y": 0.0, "z": 0.0}


def joints(**members: Any) -> dict[str, Any]:
    return {"header": ROS_2, "name": ["a", "b"], "position": [], "velocity": [], "effort": []} | members


def as_object(value: Any) -> Any:
    """The same message as a decoder's object."""
    if isinstance(value, dict):
        return SimpleNamespace(**{k: as_object(v) for k, v in value.items()})
    return [as_object(v) for v in value] if isinstance(value, list) else value


@pytest.mark.parametrize("form", [dict, as_object], ids=["mapping", "object"])
def test_a_joint_state(form: Any) -> None:
    message = form(joints(position=[1.0, 2.0], velocity=[0.5, 0.25], effort=[3.0, 4.0]))
    report = read_message(JOINT_STATE, message)
    assert report.stamp_s == 5.25
    assert report.values == {
        "pos": {"a": 1.0, "b": 2.0},
        "vel": {"a": 0.5, "b": 0.25},
        "effort": {"a": 3.0, "b": 4.0},
    }
    assert read_message(JOINT_STATE, message, field_name="ref").values == {"ref": {"a": 1.0, "b": 2.0}}


def test_members_a_robot_leaves_empty_are_not_there() -> None:
    assert set(read_message(JOINT_STATE, joints(position=[1, 2])).values) == {"pos"}
    assert set(read_message(JOINT_STATE, joints(velocity=[1.0, 2.0])).values) == {"vel"}


def test_null_and_nan_are_no_reading_and_not_zero() -> None:
    values = read_message(JOINT_STATE, joints(position=[None, math.nan])).values["pos"]
    assert values["a"] is None
    assert math.isnan(values["b"])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("stamp", "seconds"),
    [
        ({"sec": 0, "nanosec": 0}, None),
        ({"secs": 0, "nsecs": 0}, None),
        ({"sec": 0, "nanosec": 1}, 1e-9),
        ({"secs": 5, "nsecs": 0}, 5.0),
    ],
)
def test_a_stamp_of_zero_is_none(stamp: dict[str, int], seconds: float | None) -> None:
    header = {"stamp": stamp, "frame_id": ""}
    assert read_message(JOINT_STATE, joints(position=[1, 2], header=header)).stamp_s == seconds


@pytest.mark.parametrize("member", ["reference", "desired"])
def test_what_a_controller_is_told(member: str) -> None:
    point = {"positions": [0.1, 0.2], "velocities": []}
    message = {"header": ROS_2, "joint_names": ["a", "b"], member: point, "actual": {"positions": [9, 9]}}
    assert read_message(CONTROLLER_STATE, message).values == {"ref": {"a": 0.1, "b": 0.2}}


def imu(header: dict[str, Any] = ROS_2, **members: Any) -> dict[str, Any]:
    return {
        "header": header,
        "orientation": {"x": 0.1, "y": 0.2, "z": 0.3, "w": 0.9},
        "orientation_covariance": [0.0] * 9,
        "angular_velocity": ZERO,
        "angular_velocity_covariance": [0.0] * 9,
        "linear_acceleration": {"x": 1.0, "y": 2.0, "z": 9.0},
        "linear_acceleration_covariance": [0.0] * 9,
    } | members


def test_an_imu_sits_where_its_frame_says_or_where_the_profile_does() -> None:
    report = read_message(IMU, imu())
    assert report.links == {"pelvis": "pelvis"}
    assert list(report.values["quat"].items()) == [
        ("pelvis.w", 0.9),
        ("pelvis.x", 0.1),
        ("pelvis.y", 0.2),
        ("pelvis.z", 0.3),
    ]
    assert report.values["acc"] == {"pelvis.x": 1.0, "pelvis.y": 2.0, "pelvis.z": 9.0}
    given = read_message(IMU, imu(), site="torso")
    assert (list(given.values["gyro"]), given.links) == (["torso.x", "torso.y", "torso.z"], {})
    assert read_message(IMU, imu(ROS_1)).links == {"torso_imu_link": "torso/imu.link"}
    assert "imu.x" in read_message(IMU, imu({**ROS_2, "frame_id": ""})).values["gyro"]


@pytest.mark.parametrize(
    "members",
    [
        {"orientation_covariance": [-1.0] + [0.0] * 8},
        {"orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0}},
    ],
)
def test_an_imu_without_an_orientation_has_none(members: dict[str, Any]) -> None:
    values = read_message(IMU, imu(**members)).values
    assert set(values["quat"].values()) == {None}
    assert values["acc"]["pelvis.z"] == 9.0


def test_a_wrench() -> None:
    wrench = {"force": {"x": 1.0, "y": 2.0, "z": 3.0}, "torque": {"x": 4.0, "y": 5.0, "z": 6.0}}
    values = read_message(WRENCH, {"header": ROS_2, "wrench": wrench}, site="RF").values
    assert values == {
        "ftf": {"RF.fx": 1.0, "RF.fy": 2.0, "RF.fz": 3.0},
        "ftm": {"RF.mx": 4.0, "RF.my": 5.0, "RF.mz": 6.0},
    }


def test_a_battery_and_none() -> None:
    message = {
        "header": ROS_2,
        "voltage": 48.5,
        "current": -2.5,
        "percentage": 0.75,
        "power_supply_status": 2,
        "present": True,
    }
    report = read_message(BATTERY, message)
    assert report.values == {"volt": {"main": 48.5}, "amp": {"main": -2.5}, "charge": {"main": 75.0}}
    assert report.info == {"battery": "discharging"}
    gone = read_message(BATTERY, message | {"present": False}, site="left")
    assert gone.values == {"volt": {"left": None}, "amp": {"left": None}, "charge": {"left": None}}
    assert gone.info == {"battery left": "not present"}
    assert dict(gone.remarks) == {"present": "present is false, so no readings of the battery are shown"}
    empty = {"present": False, "current": 0.0, "percentage": 0.0}
    assert not read_message(BATTERY, message | empty | {"voltage": 0.0}).remarks
    assert not read_message(BATTERY, message | empty | {"voltage": None}).remarks
    assert read_message(BATTERY, message | {"percentage": None}).values["charge"] == {"main": None}
    assert read_message(BATTERY, message | {"percentage": 80}).values["charge"] == {"main": 80}


def test_an_odometry() -> None:
    pose = {
        "position": {"x": 1.0, "y": 2.0, "z": 0.8},
        "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
    }
    values = read_message(ODOMETRY, {"header": ROS_2, "pose": {"pose": pose}}).values
    assert values["base"] == {"base.x": 1.0, "base.y": 2.0, "base.z": 0.8}
    assert values["baseq"] == {"base.w": 1.0, "base.x": 0.0, "base.y": 0.0, "base.z": 0.0}


@pytest.mark.parametrize("level", [2, b"\2", "Ag=="])
def test_diagnostics_name_the_bit_however_a_byte_is_written(level: object) -> None:
    statuses = [
        {"level": level, "name": "motor 3", "message": "hot"},
        {"level": 0, "name": "battery", "message": "well"},
    ]
    report = read_message(DIAGNOSTICS, {"header": ROS_2, "status": statuses})
    assert report.values == {"diag": {"motor 3": ["error"], "battery": []}}
    assert report.info == {"motor 3": "hot", "battery": "well"}


def test_of_endless_diagnostics_the_first_count() -> None:
    statuses = [{"level": 0, "name": f"n{i}", "message": ""} for i in range(MAX_STATUSES + 10)]
    assert (
        len(read_message(DIAGNOSTICS, {"header": ROS_2, "status": statuses}).values["diag"]) == MAX_STATUSES
    )


GOOD = {"a": 1.0, "b": 2.0}
SHORT: list[tuple[dict[str, Any], dict[str, Any], list[str]]] = [
    ({"effort": [1.0]}, {"pos": GOOD}, ["effort has 1 value, name 2"]),
    ({"velocity": [1.0] * 3}, {"pos": GOOD}, ["velocity has 3 values, name 2"]),
    ({"position": [1.0], "effort": [1, 2]}, {"effort": GOOD}, ["position has 1 value, name 2"]),
    ({"effort": ["x", "y"]}, {"pos": GOOD}, ["effort of 'a' is 'x', not a number"]),
    ({"effort": [[1.0], [2.0]]}, {"pos": GOOD}, ["effort of 'a' is a list, not a number"]),
    ({"effort": "none"}, {"pos": GOOD}, ["effort is str, not a list of numbers"]),
    ({"effort": {"a": 1.0}}, {"pos": GOOD}, ["effort is dict, not a list of numbers"]),
    ({"effort": None, "velocity": None}, {"pos": GOOD}, []),
    ({"position": [1, "x"]}, {"pos": {"a": 1.0, "b": None}}, ["position of 'b' is 'x', not a number"]),
    ({"position": [True, 2]}, {"pos": {"a": None, "b": 2.0}}, ["position of 'a' is 'True', not a number"]),
    ({"position": [1, 10**400]}, {"pos": {"a": 1.0, "b": None}}, ["position of 'b' is too large"]),
    ({"name": ["a", 7]}, {"pos": {"a": 1.0}}, ["name[1] is a int, not a text"]),
    ({"name": ["a", ["b"]]}, {"pos": {"a": 1.0}}, ["name[1] is a list, not a text"]),
    ({"name": ["a", None]}, {"pos": {"a": 1.0}}, ["name[1] is a NoneType, not a text"]),
    ({"name": ["a", "x" * 201]}, {"pos": {"a": 1.0}}, ["name[1] has 201 characters, at most 200"]),
    ({"name": ["a", "a"]}, {"pos": {"a": 1.0}}, ["name[1] is 'a' again"]),
    ({"header": None}, {"pos": GOOD}, []),
    ({"header": {"stamp": "now"}}, {"pos": GOOD}, ["header.stamp is no time (the time of arrival counts)"]),
    (
        {"header": {"stamp": {"sec": "5", "nanosec": 0}}},
        {"pos": GOOD},
        ["header.stamp is no time (the time of arrival counts)"],
    ),
    (
        {"header": {"stamp": {"sec": 10**400, "nanosec": 0}}},
        {"pos": GOOD},
        ["header.stamp: OverflowError: int too large to convert to float"],
    ),
]


@pytest.mark.parametrize(("members", "values", "left_out"), SHORT)
def test_one_bad_part_of_a_joint_state_is_left_out_and_named(
    members: dict[str, Any], values: dict[str, Any], left_out: list[str]
) -> None:
    report = read_message(JOINT_STATE, joints(position=[1.0, 2.0]) | members)
    assert report.values == values
    assert list(report.left_out.values()) == left_out
    assert report.stamp_s == (None if "header" in members else 5.25)


def test_members_that_json_leaves_out_are_empty() -> None:
    report = read_message(JOINT_STATE, {"name": ["a"], "position": [1.0]})
    assert report == Report(None, {"pos": {"a": 1.0}})


def test_names_that_no_schema_can_hold_are_left_to_where_schemas_are_made() -> None:
    names = ["", "elbow\t", "\ud800", "x" * 200]
    report = read_message(JOINT_STATE, joints(name=names, position=[1.0] * 4))
    assert list(report.values["pos"]) == names


@pytest.mark.parametrize(
    "stamp",
    [
        {"sec": 5, "nanosec": 250_000_000},
        {"secs": 5, "nsecs": 250_000_000},
        {"sec": 5, "nsec": 250_000_000},
        {"sec": 5.0, "nsec": 250_000_000.0},
    ],
)
def test_a_time_is_read_as_either_ros_and_foxglove_write_it(stamp: dict[str, int]) -> None:
    header = {"stamp": stamp, "frame_id": ""}
    assert read_message(JOINT_STATE, joints(position=[1, 2], header=header)).stamp_s == 5.25


def test_an_imu_and_its_parts() -> None:
    message = imu(angular_velocity={"x": 0.1}, linear_acceleration_covariance="?")
    del message["orientation"], message["orientation_covariance"]
    report = read_message(IMU, message)
    assert report.values == {"acc": {"pelvis.x": 1.0, "pelvis.y": 2.0, "pelvis.z": 9.0}}
    assert list(report.left_out.values()) == [
        "orientation: no member 'orientation'",
        "angular_velocity: no member 'y'",
        "linear_acceleration_covariance is str, not a list of numbers",
    ]
    for frame_id in (7, "\ud800", "x" * 201):
        report = read_message(IMU, imu({**ROS_2, "frame_id": frame_id}))
        assert ("imu.x" in report.values["acc"], report.links) == (True, {})
        assert list(report.left_out) == ["frame_id"]


def test_other_sensors_and_their_parts() -> None:
    wrench = {"force": ZERO, "torque": [1, 2, 3]}
    report = read_message(WRENCH, {"wrench": wrench}, site="RF")
    assert (set(report.values), list(report.left_out)) == ({"ftf"}, ["torque"])
    report = read_message(BATTERY, {"voltage": 24.0, "current": "1", "power_supply_status": "full"})
    assert (report.values, report.info) == ({"volt": {"main": 24.0}}, {"battery": "unknown"})
    assert list(report.left_out.values()) == [
        "current is '1', not a number",
        "percentage: no member 'percentage'",
    ]
    report = read_message(ODOMETRY, {"pose": {"pose": {"position": ZERO}}})
    assert (set(report.values), list(report.left_out)) == ({"base"}, ["orientation"])
    statuses = [
        {"level": 9, "name": "a", "message": ""},
        {"level": 1, "name": "b", "message": "hot"},
        {"level": 2, "name": 7, "message": ""},
    ]
    report = read_message(DIAGNOSTICS, {"status": statuses})
    assert report.values == {"diag": {"b": ["warn"]}}
    assert list(report.left_out) == ["status[0]", "status[2]"]


def test_one_bad_transform_leaves_the_others() -> None:
    pose = {"translation": ZERO, "rotation": {"x": 0, "y": 0, "z": 0, "w": 1}}
    good = {"header": {"frame_id": "odom"}, "child_frame_id": "base", "transform": pose}
    bad = [{**good, "child_frame_id": 5}, {**good, "transform": None}, 7]
    found, left_out = read_transforms({"transforms": [bad[0], good, *bad[1:]]})
    assert [(one.parent, one.child) for one in found] == [("odom", "base")]
    assert list(left_out) == ["transforms[0]", "transforms[2]", "transforms[3]"]
    with pytest.raises(RosMessageError, match=r"transforms\[0\]: child_frame_id is int, not a text"):
        read_transforms({"transforms": bad})


@pytest.mark.parametrize(
    ("type_name", "message", "words"),
    [
        (JOINT_STATE, joints(position=[1.0]), "position has 1 value, name 2"),
        (JOINT_STATE, joints(), "a JointState without positions"),
        (JOINT_STATE, joints(name=[]), "a JointState without joints"),
        (JOINT_STATE, joints(position="12"), "position is str, not a list of numbers"),
        (JOINT_STATE, joints(position=["x", "y"]), "position of 'a' is 'x', not a number"),
        (JOINT_STATE, joints(name="ab", position=[1, 2]), "name is not a list of names"),
        (JOINT_STATE, [], "no member 'name'"),
        (JOINT_STATE, None, "no member 'name'"),
        (IMU, {"header": ROS_2}, "no member 'orientation'"),
        (WRENCH, {"header": ROS_2, "wrench": {"force": {"x": 1}}}, "no member 'y'"),
        (DIAGNOSTICS, {"header": ROS_2, "status": 5}, "status is int, not a list"),
        (DIAGNOSTICS, {"header": ROS_2, "status": [{"level": 9, "name": "a", "message": ""}]}, "level is 9"),
        (
            DIAGNOSTICS,
            {"header": ROS_2, "status": [{"level": "?", "name": "a", "message": ""}]},
            "level is '?'",
        ),
        (CONTROLLER_STATE, {"header": ROS_2, "joint_names": ["a"]}, "without target positions"),
    ],
)
def test_a_message_that_is_not_its_type_is_named(type_name: str, message: Any, words: str) -> None:
    with pytest.raises(RosMessageError, match=words.replace("?", r"\?")):
        read_message(type_name, message)


def test_a_text() -> None:
    assert get_text({"data": "<robot/>"}) == "<robot/>"
    with pytest.raises(RosMessageError):
        get_text({"data": 5})


@pytest.mark.parametrize(
    "name", ["sensor_msgs/JointState", "sensor_msgs/msg/JointState", "sensor_msgs::msg::dds_::JointState_"]
)
def test_a_type_has_one_short_name(name: str) -> None:
    assert shorten_type(name) == JOINT_STATE
