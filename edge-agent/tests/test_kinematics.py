"""The manifest's own kinematics against an independent library's, robot by robot."""

from __future__ import annotations

import io
import json
import math
import random
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import yourdfpy
from model_stage import ROBOTS, joint, link, robot, shared_robot, written
from posecast_edge.model.builder.manifest import compute_home, encode_manifest, make_skeleton
from posecast_edge.model.kinematics import compute_link_poses, quaternion_from_rpy
from posecast_edge.model.urdf.reader import load_urdf
from posecast_edge.model.urdf.tree import build_tree
from trimesh import transformations as untyped

transformations: Any = untyped
CONFIGURATIONS = 20
MILLIMETRE = 1e-3


def manifest_of(path: Path) -> dict[str, Any]:
    """As a viewer gets it: through its bytes."""
    urdf = load_urdf(path)
    document: dict[str, Any] = json.loads(encode_manifest(make_skeleton(urdf, build_tree(urdf))))
    return document


def independent(path: Path) -> Any:
    """yourdfpy's robot; without shapes, of which it wants all to be well formed."""
    tree = ElementTree.parse(path)
    for link_element in tree.getroot().iter("link"):
        for shape in [*link_element.findall("visual"), *link_element.findall("collision")]:
            link_element.remove(shape)
    text = io.BytesIO(ElementTree.tostring(tree.getroot()))
    return yourdfpy.URDF.load(text, build_scene_graph=True, load_meshes=False)


def compare(path: Path, seed: int) -> None:
    manifest = manifest_of(path)
    other = independent(path)
    moving = [j["name"] for j in manifest["joints"] if j["type"] in ("revolute", "continuous", "prismatic")]
    free = [j["name"] for j in manifest["joints"] if j["name"] in moving and not j.get("mimic")]
    assert set(other.actuated_joint_names) == set(free)
    chance = random.Random(seed)
    for _ in range(CONFIGURATIONS):
        readings = {name: chance.uniform(-math.pi, math.pi) for name in free}  # limits do not count
        other.update_cfg(readings)
        poses = compute_link_poses(manifest, readings)
        assert list(poses) == manifest["links"]
        assert set(poses) == set(other.link_map)
        for name, pose in poses.items():
            expected = other.get_transform(name, manifest["links"][0])
            assert np.abs(np.array(pose)[:3, 3] - expected[:3, 3]).max() < MILLIMETRE, name
            assert np.abs(np.array(pose)[:3, :3] - expected[:3, :3]).max() < MILLIMETRE, name


@pytest.mark.parametrize("name", ROBOTS)
def test_shared_robots(name: str) -> None:
    compare(shared_robot(name), seed=4)


def test_every_type_of_joint(tmp_path: Path) -> None:
    def turned(axis: str, more: str = "") -> str:
        return f'<origin xyz="0.1 -0.2 0.3" rpy="0.4 -0.5 2.6"/><axis xyz="{axis}"/>{more}'

    parts = [
        *(link(name) for name in "abcdefgh"),
        joint("r", "a", "b", "revolute", turned("0.6 0 0.8")),
        joint("c", "b", "c", "continuous", turned("0 -1 0"), ""),
        joint("p", "b", "d", "prismatic", turned("0 0.6 0.8")),
        joint("m", "d", "e", "revolute", turned("1 0 0", '<mimic joint="r" multiplier="-2" offset="0.3"/>')),
        joint("f", "e", "f", "fixed", '<origin xyz="1 2 3" rpy="1 2 3"/>', ""),
        joint("n", "f", "g", "prismatic", turned("0 0 1", '<mimic joint="p"/>')),
        joint("z", "g", "h", "revolute", turned("0 0 1")),
    ]
    compare(written(tmp_path, robot(*parts)), seed=1)


TURNED = '<origin xyz="0.1 -0.2 0.3" rpy="0.4 -0.5 2.6"/>'
FLOATING = [f"trans_{c}" for c in "xyz"] + [f"rot_{c}" for c in "xyzw"]


def free_joint(folder: Path, kind: str, inside: str = TURNED) -> tuple[dict[str, Any], np.ndarray[Any, Any]]:
    """A robot whose only joint `j` is that, and parent_from_joint by trimesh."""
    manifest = manifest_of(
        written(folder, robot(link("a"), link("b"), joint("j", "a", "b", kind, inside, "")))
    )
    origin = transformations.euler_matrix(0.4, -0.5, 2.6, "sxyz")
    origin[:3, 3] = 0.1, -0.2, 0.3
    return manifest, origin


def test_a_floating_joint(tmp_path: Path) -> None:
    manifest, origin = free_joint(tmp_path, "floating")
    assert manifest["joints"][0]["type"] == "floating"
    assert "limits" not in manifest["joints"][0]
    chance = np.random.default_rng(3)
    for _ in range(CONFIGURATIONS):
        x, y, z, *quat = chance.normal(size=7)  # of any length: it is brought to 1
        moved = transformations.quaternion_matrix([quat[3], *quat[:3]])
        moved[:3, 3] = x, y, z
        readings = {f"j/{part}": v for part, v in zip(FLOATING, (x, y, z, *quat), strict=True)}
        assert np.allclose(compute_link_poses(manifest, readings)["b"], origin @ moved)


def test_a_floating_joint_of_which_little_is_known(tmp_path: Path) -> None:
    manifest, origin = free_joint(tmp_path, "floating")
    assert np.allclose(compute_link_poses(manifest, {"j": 1.0})["b"], origin)
    slid = origin @ transformations.translation_matrix([0, 2, 0])
    assert np.allclose(compute_link_poses(manifest, {"j/trans_y": 2.0})["b"], slid)
    assert np.allclose(compute_link_poses(manifest, {"j/trans_y": 2.0, "j/rot_w": 0.0})["b"], slid)
    half = origin @ transformations.rotation_matrix(math.pi / 2, [0, 0, 1])
    assert np.allclose(compute_link_poses(manifest, {"j/rot_z": 1.0})["b"], half)  # with rot_w at rest, 1


@pytest.mark.parametrize(
    ("axis", "x", "y"),
    [
        ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
        ((0, 0, -1), (1, 0, 0), (0, -1, 0)),
        ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
        ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
        ((0.48, -0.6, 0.64), None, None),
        ((0.001, 0, -1), None, None),
    ],
)
def test_a_planar_joint(
    tmp_path: Path, axis: tuple[float, ...], x: tuple[float, ...] | None, y: tuple[float, ...] | None
) -> None:
    inside = f'{TURNED}<axis xyz="{axis[0]} {axis[1]} {axis[2]}"/>'
    manifest, origin = free_joint(tmp_path, "planar", inside)
    u, v = np.array(manifest["joints"][0]["plane"])
    normal = np.array(axis) / np.linalg.norm(axis)
    assert np.allclose(np.cross(u, v), normal)
    assert np.allclose([u @ u, v @ v, u @ v], [1, 1, 0])
    assert x is None or np.allclose(u, x)
    assert y is None or np.allclose(v, y)
    moved = transformations.rotation_matrix(0.7, normal)
    moved[:3, 3] = 0.3 * u - 2 * v
    assert np.allclose(
        compute_link_poses(manifest, {"j/x": 0.3, "j/y": -2.0, "j/theta": 0.7})["b"], origin @ moved
    )
    assert np.allclose(compute_link_poses(manifest, {"j": 1.0})["b"], origin)


def test_order_and_root_do_not_depend_on_the_file(tmp_path: Path) -> None:
    parts = [joint("bc", "b", "c"), link("c"), joint("ab", "a", "b"), link("b"), link("a")]
    manifest = manifest_of(written(tmp_path, robot(*parts)))
    assert manifest["links"] == ["a", "b", "c"]
    assert [j["child"] for j in manifest["joints"]] == [1, 2]
    assert [j["parent"] for j in manifest["joints"]] == [0, 1]


def test_mimics_of_mimics_are_resolved(tmp_path: Path) -> None:
    def mimics(name: str, multiplier: float, offset: float) -> str:
        return f'<axis xyz="0 0 1"/><mimic joint="{name}" multiplier="{multiplier}" offset="{offset}"/>'

    parts = [
        *(link(name) for name in "abcd"),
        joint("x", "a", "b"),
        joint("y", "b", "c", inside=mimics("x", 2, 0.1)),
        joint("z", "c", "d", inside=mimics("y", -3, 0.5)),
    ]
    manifest = manifest_of(written(tmp_path, robot(*parts)))
    assert manifest["joints"][2]["mimic"] == {"joint": 0, "multiplier": -6, "offset": 0.2}
    poses = compute_link_poses(manifest, {"x": 0.1})
    turn = 0.1 + (2 * 0.1 + 0.1) + (-6 * 0.1 + 0.2)
    assert poses["d"][0][0] == pytest.approx(math.cos(turn))
    # a reading of its own wins
    assert compute_link_poses(manifest, {"x": 0.1, "z": 1.0})["d"][0][0] == pytest.approx(
        math.cos(0.1 + 0.3 + 1.0)
    )


def test_home_is_zero_or_the_nearest_limit(tmp_path: Path) -> None:
    parts = [
        *(link(name) for name in "abcd"),
        joint("x", "a", "b"),
        joint("y", "b", "c", limit='<limit lower="0.5" upper="1"/>'),
        joint("z", "c", "d", limit='<limit lower="-2" upper="-1"/>'),
    ]
    assert compute_home(manifest_of(written(tmp_path, robot(*parts)))) == {"x": 0, "y": 0.5, "z": -1}


def test_a_deep_chain(tmp_path: Path) -> None:
    parts = [link("l0")]
    for i in range(900):
        parts += [
            link(f"l{i + 1}"),
            joint(f"j{i}", f"l{i}", f"l{i + 1}", "fixed", '<origin xyz="0 0 0.01"/>', ""),
        ]
    poses = compute_link_poses(manifest_of(written(tmp_path, robot(*parts))), {})
    assert poses["l900"][2][3] == pytest.approx(9.0)


@pytest.mark.parametrize(
    "rpy", [(0, 0, 0), (0.1, 0.2, 0.3), (3, -1.5, 2), (0, math.pi / 2, 1), (math.pi, 0, 0)]
)
def test_quaternion_from_rpy(rpy: tuple[float, float, float]) -> None:
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in rpy)
    turn = (
        np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
        @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    )
    w, x, y, z = quaternion_from_rpy(rpy)
    point = np.array([0.3, -0.7, 0.2])
    twice = 2 * np.cross([x, y, z], point)
    assert np.allclose(turn @ point, point + w * twice + np.cross([x, y, z], twice))
    assert w >= 0
