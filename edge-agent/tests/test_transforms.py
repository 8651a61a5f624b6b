"""/tf → where the base is; compared with matrices."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from posecast_edge.sources.ros.messages import Report, RosMessageError, read_transforms
from posecast_edge.sources.ros.transforms import FRAMES_MAX, OLD_S, WAIT_S, TransformTree

Edge = tuple[str, str, Sequence[float], Sequence[float]]


def take(tree: TransformTree, message: Any, static: bool, now_s: float) -> Report | None:
    return tree.take_transforms(read_transforms(message)[0], static, now_s)


def message(*edges: Edge, stamp_s: int = 5) -> dict[str, Any]:
    """As rosbridge has it."""
    return {
        "transforms": [
            {
                "header": {"stamp": {"sec": stamp_s, "nanosec": 0}, "frame_id": parent},
                "child_frame_id": child,
                "transform": {
                    "translation": dict(zip("xyz", xyz, strict=True)),
                    "rotation": dict(zip("wxyz", wxyz, strict=True)),
                },
            }
            for parent, child, xyz, wxyz in edges
        ]
    }


def tree(base: tuple[str, str] | None = ("odom", "base_link")) -> tuple[TransformTree, list[str]]:
    said: list[str] = []
    return TransformTree(base, said.append), said


def turn(*axis_angle: float) -> list[float]:
    x, y, z, angle = axis_angle
    return [math.cos(angle / 2), *(c * math.sin(angle / 2) for c in (x, y, z))]


def matrix(xyz: Sequence[float], wxyz: Sequence[float]) -> np.ndarray:
    w, x, y, z = wxyz
    made = np.eye(4)
    made[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    made[:3, 3] = xyz
    return made


def pose(report: Report | None) -> np.ndarray:
    assert report is not None
    base, turned = report.values["base"], report.values["baseq"]
    return matrix([base[f"base.{c}"] for c in "xyz"], [turned[f"base.{c}"] for c in "wxyz"])  # type: ignore[misc]


A: Edge = ("odom", "a", (1, 2, 3), turn(0, 0, 1, 0.7))
B: Edge = ("a", "base_link", (0.5, -1, 2), turn(0.6, 0.8, 0, 1.1))
UP: Edge = ("world", "odom", (4, 5, 6), turn(0, 1, 0, -2.0))
SIDE: Edge = ("world", "lab", (-1, 0, 2), turn(1, 0, 0, 0.4))


def test_a_chain_is_composed() -> None:
    frames, said = tree()
    assert take(frames, message(A), False, 1.0) is None
    report = take(frames, message(B, stamp_s=9), False, 1.1)
    assert report is not None
    assert (report.stamp_s, report.lasts) == (9, False)
    np.testing.assert_allclose(pose(report), matrix(*A[2:]) @ matrix(*B[2:]), atol=1e-12)
    assert said == []


def test_a_chain_up_and_down_the_tree() -> None:
    frames, _ = tree(("lab", "base_link"))
    report = take(frames, message(B, A, SIDE, UP), False, 1.0)
    wanted = np.linalg.inv(matrix(*SIDE[2:])) @ matrix(*UP[2:]) @ matrix(*A[2:]) @ matrix(*B[2:])
    np.testing.assert_allclose(pose(report), wanted, atol=1e-12)


def test_the_moving_transform_nearest_to_the_base_makes_the_pose() -> None:
    """SLAM that goes on tells of no life of the odometry."""
    frames, said = tree(("world", "base_link"))
    take(frames, message(B), True, 0.5)
    assert take(frames, message(UP, A), False, 1.0) is not None
    assert take(frames, message(UP), False, 2.0) is None
    assert take(frames, message(("x", "y", (0, 0, 0), (1, 0, 0, 0))), False, 2.0) is None
    assert take(frames, message(A), False, 3.0) is not None
    assert take(frames, message(A), False, 3.0 + OLD_S) is None
    assert said == [f"no transform of odom for {OLD_S:g} s: the base has no pose"]


def test_a_static_chain_is_told_once_and_lasts() -> None:
    frames, _ = tree()
    report = take(frames, message(A, B), True, 1.0)
    assert report is not None
    assert (report.stamp_s, report.lasts) == (None, True)


def test_slashes_and_quaternions_of_any_length() -> None:
    frames, _ = tree(("odom", "a"))
    report = take(frames, message(("/odom", "/a", (0, 0, 0), (0, 0, 0, 3))), False, 1.0)
    assert report is not None
    assert report.values["baseq"] == {"base.w": 0, "base.x": 0, "base.y": 0, "base.z": 1}


@pytest.mark.parametrize(
    ("edges", "line"),
    [
        ([A], "base odom→base_link: no transform names base_link; frames: a, odom"),
        ([B], "base odom→base_link: no transform names odom; frames: a, base_link"),
        (
            [A, ("a", "odom", (0, 0, 0), (1, 0, 0, 0)), ("x", "base_link", (0, 0, 0), (1, 0, 0, 0))],
            "base odom→base_link: the transforms form a loop: odom → a → odom",
        ),
        (
            [A, ("x", "base_link", (0, 0, 0), (1, 0, 0, 0))],
            "base odom→base_link: no transforms connect the two",
        ),
    ],
)
def test_what_is_missing_is_said_once(edges: list[Edge], line: str) -> None:
    frames, said = tree()
    for k in range(4):
        take(frames, message(*edges), False, 1 + k * WAIT_S / 2)
        frames.check_time(1 + k * WAIT_S / 2)
        assert said == ([line] if k >= 2 else [])


def test_what_is_no_transform() -> None:
    frames, said = tree()
    nothing = [("odom", "a", (math.nan, 0, 0), (1, 0, 0, 0)), ("a", "b", (0, 0, 0), (0, 0, 0, 0))]
    nothing += [("", "a", (0, 0, 0), (1, 0, 0, 0)), ("c", "c", (0, 0, 0), (1, 0, 0, 0))]
    assert take(frames, message(*nothing), False, 1.0) is None
    assert frames.list_frames() == []
    cases: list[Any] = [{}, {"transforms": 5}, {"transforms": [5]}, {"transforms": [{}] * 5000}]
    for bad in cases:
        with pytest.raises(RosMessageError):
            take(frames, bad, False, 1.0)
    assert said == []


def test_frames_are_bounded() -> None:
    frames, said = tree()
    for k in range(FRAMES_MAX + 500):
        take(frames, message((f"{k}", f"{k + 1}", (0, 0, 0), (1, 0, 0, 0))), False, 1.0)
    assert said == [f"more than {FRAMES_MAX} frames: {FRAMES_MAX + 1} and further ones are left out"]
    assert len(frames.list_frames()) <= 42


def test_what_probe_shows() -> None:
    frames, _ = tree(None)
    mast: Edge = ("base_link", "mast", (0, 0, 1), (1, 0, 0, 0))
    take(frames, message(UP, A, B), False, 1.0)
    take(frames, message(mast), True, 1.0)
    assert frames.list_frames() == [
        "frame a → base_link",
        "frame base_link → mast (static)",
        "frame odom → a",
        "frame world → odom",
        'to show where the robot is, in a profile: [ros] base = "odom→base_link"',
    ]
