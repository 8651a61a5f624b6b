"""The demo bundle: always the same, small, every shell closed, one tree."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
import yourdfpy
from demo_stage import BUILD, Minute, Skeleton, build
from posecast_edge.profile.reader import load_profile
from posecast_edge.sources.demo import PROFILE


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_two_builds_are_equal_and_an_old_mesh_goes(bundle: Path, tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "gone.stl").write_bytes(b"of an older robot")
    assert contents(build(tmp_path)) == contents(bundle)


def test_it_is_small(bundle: Path) -> None:
    meshes = list((bundle / "meshes").glob("*.stl"))
    size = sum(p.stat().st_size for p in meshes)
    assert size <= 3_000_000
    assert (size - 84 * len(meshes)) / 50 <= 60_000, "triangles"
    assert (bundle / "motion.bin").stat().st_size <= 700_000


def test_every_shell_is_closed_and_outwards(bundle: Path) -> None:
    for path in sorted((bundle / "meshes").glob("*.stl")):
        mesh = trimesh.load_mesh(path)
        assert mesh.is_watertight, path.name
        assert mesh.is_winding_consistent, path.name
        assert all(part.volume > 0 for part in mesh.split()), path.name


def test_urdf_is_a_tree_whose_meshes_are_all_there_and_used(bundle: Path) -> None:
    robot = yourdfpy.URDF.load(str(bundle / "robot.urdf"), load_meshes=False).robot
    assert len(robot.joints) == len(robot.links) - 1
    assert {j.child for j in robot.joints} | {"Body_Hip"} == {link.name for link in robot.links}
    used = {v.geometry.mesh.filename for link in robot.links for v in link.visuals}
    assert used == {f"meshes/{p.name}" for p in (bundle / "meshes").iterdir()}
    named = {m.name for m in robot.materials}
    assert {v.material.name for link in robot.links for v in link.visuals} <= named
    assert all(link.visuals for link in robot.links), "a link nobody sees"


def test_kinematics_agree_with_yourdfpy(bundle: Path, minute: Minute) -> None:
    robot = yourdfpy.URDF.load(str(bundle / "robot.urdf"), load_meshes=False)
    angles = minute.angles("pos")
    links = ("Body_LAR", "Body_RWP", "Body_Head", "leftThumbDistal", "rightPinkyDistal")
    ours = {link: minute.skeleton.pose(link, angles, np.eye(4)[None]) for link in links}
    for k in (0, 333, 1800, 2500):
        robot.update_cfg({j: angles[j][k % len(angles[j])] for j in robot.actuated_joint_names})
        for link in links:
            theirs = robot.get_transform(link, "Body_Hip")
            assert np.allclose(ours[link][k], theirs, atol=1e-9), (link, k)


def test_the_profile_maps_every_joint_and_mounts_sensors_on_links(
    bundle: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(BUILD.parent))
    from demo_robot.robot import mapping  # the builder's own table

    profile, skeleton = load_profile(PROFILE), Skeleton(bundle / "robot.urdf")
    joint = profile.labels["joint"]
    said: dict[str, tuple[tuple[str, float], ...]]
    said = {name: ((name, 1.0),) for name in joint if name in skeleton.joints}
    said |= {name: how.terms for name, how in profile.mapping.joints.items()}
    assert said == {name: terms for name, (terms, _) in mapping().items()}
    for name, (_, offset) in mapping().items():
        how = profile.mapping.joints.get(name)
        assert (how.offset if how else 0.0) == pytest.approx(offset), name
    assert set(said) == set(skeleton.joints)
    assert len(joint) == 40
    assert {m.link for m in profile.mapping.sensors.values()} <= set(skeleton.links)
    assert profile.root == skeleton.root


def test_motion_and_profile_have_the_same_channels(minute: Minute) -> None:
    for track in minute.motion.tracks:
        spec = minute.profile.find_field(track.name)
        assert spec is not None, track.name
        assert len(track.columns) == len(spec.labels), track.name
    assert len(minute.motion.tracks) == len(minute.profile.fields)
