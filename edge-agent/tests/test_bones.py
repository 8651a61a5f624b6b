"""A robot that shows hardly anything of itself is drawn as its skeleton.

spa/tests/urdf/bones.test.ts has the same."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from model_stage import build_robot, joint, mesh, robot, written

BALL = '<geometry><sphere radius="0.1"/></geometry>'


def link(name: str, inside: str = "") -> str:
    """A link, by default without a visual."""
    return f"<link name='{name}'>{inside}</link>"


def turning(name: str, parent: str, child: str, xyz: str, kind: str = "revolute") -> str:
    """A joint about (along) y."""
    inside = f'<origin xyz="{xyz}"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'
    return joint(name, parent, child, inside=inside, kind=kind)


JOINTS = (turning("ab", "a", "b", "0 0 0.5"), turning("bc", "b", "c", "0.3 0 0", "prismatic"))


def shown(tmp_path: Path, *parts: str) -> list[dict[str, Any]]:
    visuals: list[dict[str, Any]] = build_robot(written(tmp_path, robot(*parts))).document["visuals"]
    return visuals


def test_links_become_bones_and_joints_their_axes(tmp_path: Path) -> None:
    built = build_robot(written(tmp_path, robot(link("a"), link("b"), link("c"), *JOINTS)))
    visuals = built.document["visuals"]
    assert [(v["link"], v["source"], v.get("placeholder")) for v in visuals] == [
        (0, "bones", None),
        (1, "bones", None),
        (2, "bones", None),
    ]
    disc, bar = 0.0192, 0.0192  # 0.024 of 0.8 m: a disc's radius; a bar is 5 of them long
    boxes = [np.array(v["box"]) for v in visuals]
    assert boxes[0] == pytest.approx(np.array([[-0.0128, -0.0128, 0], [0.0128, 0.0128, 0.5]]), abs=2e-4)
    assert boxes[1] == pytest.approx(
        np.array([[-disc, -0.75 * disc, -disc], [0.3, 0.75 * disc, disc]]), abs=2e-4
    )
    assert boxes[2][:, 1] == pytest.approx([-2.5 * bar, 2.5 * bar], abs=2e-4)
    assert boxes[2][1][0] == pytest.approx(0.4 * 0.3, abs=2e-4), "on in the direction of the bone before"
    assert len({v["color"] for v in visuals}) == 3, "axes have a colour of their own"
    assert len(built.files["thumbnail.png"]) > 500


def test_few_links_without_shells_get_none(tmp_path: Path) -> None:
    """Frames, sensors and the small links between two axes are no body."""
    dressed = [f"<link name='{name}'><visual>{BALL}</visual></link>" for name in "abc"]
    parts = [
        *dressed,
        link("d"),
        link("e"),
        *JOINTS,
        turning("cd", "c", "d", "0 0 0.1"),
        joint("de", "d", "e"),
    ]
    assert [v["source"] for v in shown(tmp_path, *parts)] == ["sphere"] * 3


def test_one_collision_shape_does_not_hide_the_skeleton(tmp_path: Path) -> None:
    hull = (
        "<link name='a'><collision><geometry><cylinder radius='1' length='1'/></geometry></collision></link>"
    )
    visuals = shown(tmp_path, hull, *map(link, "bcd"), *JOINTS, turning("cd", "c", "d", "0.2 0 0"))
    assert [v["source"] for v in visuals] == ["bones"] * 4
    each = [f"<link name='{name}'><collision>{BALL}</collision></link>" for name in "abc"]
    assert [v["source"] for v in shown(tmp_path, *each, *JOINTS)] == ["sphere"] * 3


def test_meshes_that_are_all_missing_leave_the_skeleton(tmp_path: Path) -> None:
    parts = [link(name, mesh(f"meshes/{name}.stl")) for name in "abc"]
    built = build_robot(written(tmp_path, robot(*parts, *JOINTS)))
    visuals = built.document["visuals"]
    assert [(v["source"], v["placeholder"].partition(";")[0]) for v in visuals] == [
        (f"meshes/{name}.stl", "no such file") for name in "abc"
    ]
    assert visuals[0]["box"][1] == pytest.approx([0.0128, 0.0128, 0.5], abs=2e-4)
    assert len(built.document["missing"]) == 3


def test_a_robot_all_in_one_place_and_one_of_a_thousand_links(tmp_path: Path) -> None:
    """No bone has a length, or each is like the other: then they are one mesh."""
    nowhere = [turning("ab", "a", "b", "0 0 0"), turning("bc", "b", "c", "0 0 0")]
    assert shown(tmp_path, link("a"), link("b"), link("c"), *nowhere) == []
    names = [f"l{i}" for i in range(1000)]
    chain = [turning(f"j{b}", a, b, "0.1 0 0") for a, b in pairwise(names)]
    built = build_robot(written(tmp_path, robot(*map(link, names), *chain)))
    assert len(built.document["visuals"]) == 1000
    assert len(built.figure.looks) <= 4


def test_what_is_too_long_is_left_out(tmp_path: Path) -> None:
    far = turning("bc", "b", "c", "1e6 0 0")
    visuals = shown(tmp_path, link("a"), link("b"), link("c"), turning("ab", "a", "b", "0 0 0.5"), far)
    assert all(np.isfinite(v["box"]).all() for v in visuals)
