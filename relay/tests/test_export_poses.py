"""Where links are in /tf: as the page has them (spa/tests/model/kinematics.test.ts reads the same cases)."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from posecast_relay.export.link_poses import FrameReadings, LinkPoses
from posecast_relay.export.model_tree import ModelTreeError, read_model_tree
from posecast_relay.export.rotation import (
    invert_quat,
    multiply_quats,
    normalise_quat,
    quat_of_rpy,
    remove_heading,
    rotate_vector,
)
from posecast_wire import Schema

from .link_pose_cases import VECTORS, make_manifest, make_schema, place_links

CASES = json.loads(VECTORS.read_text())["cases"]

NOT_BUILT = "v: a URDF that has not been built; the robot's program does that with the extra `model`"


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_links_are_where_the_page_has_them(case: dict[str, Any]) -> None:
    tree = read_model_tree(json.dumps(case["manifest"]).encode())
    poses = LinkPoses(tree)
    readings = FrameReadings(Schema.parse(case["schema"]))
    for frame in case["frames"]:
        readings.take(frame["codes"])
        poses.update(readings)
        for pose, wanted in zip(place_links(tree, poses), frame["links"], strict=True):
            assert math.dist(pose.xyz, wanted[:3]) < 1e-6
            turned = multiply_quats(invert_quat(pose.quat), tuple(wanted[3:]))
            assert abs(turned[0]) == pytest.approx(1, abs=1e-6)


def test_a_joint_stays_where_it_was_when_another_schema_lacks_it() -> None:
    poses = LinkPoses(read_model_tree(json.dumps(make_manifest()).encode()))
    for text in (make_schema({}), make_schema({}, channels=["knee"])):
        schema = Schema.parse(text)
        readings = FrameReadings(schema)
        readings.take([100] * schema.size)
        poses.update(readings)
    assert poses.poses[1].xyz == pytest.approx((0, 0.06, 0.48)), "lift"


def test_no_factor_that_a_robot_wrote_stops_the_export() -> None:
    manifest = make_manifest()
    manifest["joints"][3]["mimic"] = {"joint": 2, "multiplier": 1e308, "offset": 1e308}
    poses = LinkPoses(read_model_tree(json.dumps(manifest).encode()))
    schema = Schema.parse(make_schema({}))
    codes = [3000] * schema.size
    codes[schema.fields[0].labels.index("toe")] = -(1 << 28)
    readings = FrameReadings(schema)
    readings.take(codes)
    poses.update(readings)
    assert math.isnan(poses.poses[4].quat[0])


def test_rotations_obey_their_laws() -> None:
    a, b = quat_of_rpy((0.3, -1.1, 2.0)), quat_of_rpy((-2.2, 0.4, 0.1))
    vector = (0.2, -3.0, 1.5)
    assert rotate_vector(multiply_quats(a, b), vector) == pytest.approx(
        rotate_vector(a, rotate_vector(b, vector))
    )
    assert rotate_vector(invert_quat(a), rotate_vector(a, vector)) == pytest.approx(vector)
    assert rotate_vector(quat_of_rpy((0, 0, math.pi / 2)), (1, 0, 0)) == pytest.approx((0, 1, 0))
    assert remove_heading(quat_of_rpy((0.1, 0, 2.0))) == pytest.approx(quat_of_rpy((0.1, 0, 0)))
    assert normalise_quat((0, 0, 0, 0)) is None
    assert normalise_quat((math.nan, 0, 0, 1)) is None


def broken(path: str, value: Any) -> bytes:
    """A manifest with another value at a path, as `joints.2.axis`; no value where it is ..."""
    manifest = make_manifest()
    *way, last = path.split(".")
    at: Any = manifest
    for part in way:
        at = at[int(part)] if part.isdigit() else at[part]
    if value is ...:
        del at[last]
    else:
        at[int(last) if last.isdigit() else last] = value
    return json.dumps(manifest).encode()


@pytest.mark.parametrize(
    ("manifest", "line"),
    [
        (b"{", "manifest: not JSON"),
        (b"[]", "manifest: no object"),
        (b" " * (1 << 20) + b"{}", "manifest: over 1048576 bytes"),
        (broken("v", 1), NOT_BUILT),
        (broken("links", []), "links: none"),
        (broken("links", ["a"] * 1001), "links: 1001 are too many"),
        (broken("links.1", "trunk"), "links: a name is used twice"),
        (broken("links.1", 5), "links[1]: no name"),
        (broken("joints", []), "joints: 9 links need 8"),
        (broken("joints.2.child", 1), "joints[2]: its child is not link 3"),
        (broken("joints.2.parent", 3), "joints[2]: its parent comes after it"),
        (broken("joints.2.type", "ball"), "joints[2]: unknown type"),
        (broken("joints.2.name", ...), "joints[2].name: no name"),
        (broken("joints.2.axis", [0, 1]), "joints[2].axis: not 3 numbers"),
        (broken("joints.2.axis", [0, 0, 2]), "joints[2].axis: not of length 1"),
        (broken("joints.2.xyz", [0, 0, "1"]), "joints[2].xyz: no number"),
        (broken("joints.6.plane", [[1, 0, 0]]), "joints[6].plane: not two directions"),
        (broken("joints.3.mimic", 4), "joints[3].mimic: no object"),
        (broken("joints.3.mimic", {"joint": 8}), "joints[3]: mimics a joint that is not there"),
        (broken("joints.3.mimic", {"joint": -1}), "joints[3].mimic: not the index of a joint"),
        (broken("visuals.0.link", 9), "visuals[0]: its link is not there"),
        (broken("visuals.0.box", [[0, 0, 0]]), "visuals[0].box: not two corners"),
    ],
)
def test_a_manifest_that_poses_nothing_is_refused_in_one_line(manifest: bytes, line: str) -> None:
    with pytest.raises(ModelTreeError) as caught:
        read_model_tree(manifest)
    assert str(caught.value) == line
