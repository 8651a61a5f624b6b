"""The joints that one value moves: of a model as it is read, and of the same once it is built."""

from __future__ import annotations

import io
import json
import math

from posecast_edge.model.builder.manifest import encode_manifest, make_skeleton
from posecast_edge.model.moving_joints import list_built_joints, list_moving_joints
from posecast_edge.model.urdf.reader import read_urdf
from posecast_edge.model.urdf.tree import build_tree

JOINT = '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>{4}</joint>'
LIMIT = '<limit lower="-1" upper="2" effort="1" velocity="1"/>'
LINKS = "".join(f'<link name="{name}"/>' for name in "abcdefg")
ROBOT = f"""<robot name="r">{LINKS}
{JOINT.format("turn", "revolute", "a", "b", LIMIT + '<origin xyz="1 2 3" rpy="0 0 1.5"/><axis xyz="0 3 4"/>')}
{JOINT.format("spin", "continuous", "b", "c", LIMIT)}
{JOINT.format("slide", "prismatic", "c", "d", '<axis xyz="0 0 2"/>')}
{JOINT.format("glue", "fixed", "d", "e", "")}
{JOINT.format("float", "floating", "e", "f", "")}
{JOINT.format("shadow", "revolute", "e", "g", LIMIT + '<mimic joint="turn"/>')}
</robot>"""


def test_joints_of_a_model_as_it_is_and_as_it_is_built() -> None:
    urdf = read_urdf(io.BytesIO(ROBOT.encode()))
    turn, spin, slide = joints = list_moving_joints(urdf)
    assert [(j.name, j.slides, j.parent, j.child) for j in joints] == [
        ("turn", False, "a", "b"),
        ("spin", False, "b", "c"),
        ("slide", True, "c", "d"),
    ]
    assert (turn.xyz, turn.axis, turn.lower, turn.upper) == ((1, 2, 3), (0, 0.6, 0.8), -1, 2)
    assert turn.quat == (math.cos(0.75), 0, 0, math.sin(0.75))
    assert (spin.axis, spin.lower, spin.upper) == ((1, 0, 0), None, None)
    assert slide.axis == (0, 0, 1)
    built = list_built_joints(encode_manifest(make_skeleton(urdf, build_tree(urdf))))
    assert [(j.name, j.slides, j.parent, j.child, j.xyz, j.axis, j.lower, j.upper) for j in built] == [
        (j.name, j.slides, j.parent, j.child, j.xyz, j.axis, j.lower, j.upper) for j in joints
    ]


def test_what_no_manifest_should_hold_is_left_out() -> None:
    good = {"name": "a", "type": "revolute", "parent": 0, "child": 1}
    good |= {"xyz": [0, 0, 0], "quat": [1, 0, 0, 0], "axis": [0, 0, 1]}
    bad = [5, {}, {**good, "child": 7}, {**good, "axis": "z"}, {**good, "xyz": [0, 1e999, 0]}]
    document = {"links": ["base", "tip"], "joints": [*bad, good]}
    assert [joint.name for joint in list_built_joints(json.dumps(document).encode())] == ["a"]
    for nothing in ({}, {"links": 1, "joints": []}, {"links": [], "joints": 3}):
        assert list_built_joints(json.dumps(nothing).encode()) == ()
