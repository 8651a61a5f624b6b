"""Measures how far a built robot's links are from their positions in MuJoCo or Pinocchio."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from posecast_edge.model.kinematics import compute_link_poses, list_variables

CONFIGURATIONS = 20
SLIDE_M = 0.5  # range of a prismatic joint
MUJOCO_BALL, MUJOCO_SLIDE, MUJOCO_HINGE = 1, 2, 3

Manifest = Mapping[str, Any]
Matrix = NDArray[np.float64]


class Worst:
    """The largest difference so far: `distance_m` between origins, `turn` between elements of the rotation
    matrices; `links`: how many links were compared each time."""

    def __init__(self) -> None:
        self.distance_m = self.turn = 0.0
        self.links = 0

    def add_configuration(
        self, poses: Mapping[str, Sequence[Sequence[float]]], others: Mapping[str, Matrix]
    ) -> None:
        """Compare root_from_link of every link that both have."""
        self.links = len(others.keys() & poses.keys())
        for name in others.keys() & poses.keys():
            pose, other = np.array(poses[name]), others[name]
            self.distance_m = max(self.distance_m, float(np.linalg.norm(pose[:3, 3] - other[:3, 3])))
            self.turn = max(self.turn, float(np.abs(pose[:3, :3] - other[:3, :3]).max()))


def compare_with_mujoco(manifest: Manifest, path: Path, seed: int) -> Worst:
    """Compare a body built from MJCF with MuJoCo's kinematics."""
    import mujoco  # noqa: PLC0415 - it may not be installed
    from posecast_edge.model.mjcf.bodies import find_soft_bodies  # noqa: PLC0415 - the same
    from posecast_edge.model.mjcf.compiler import name_joints  # noqa: PLC0415 - the same

    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    bodies = {model.body(i).name or f"body{i}": i for i in range(model.nbody)}
    compared = {name: bodies[name] for name in manifest["links"] if name in bodies}
    root = bodies[manifest["links"][0]]
    names = name_joints(model, find_soft_bodies(model), model.nu > 0)
    chance = np.random.default_rng(seed)
    worst = Worst()
    for _ in range(CONFIGURATIONS):
        data.qpos[:] = model.qpos0
        readings: dict[str, float] = {}
        for i in range(model.njnt):
            kind, start = int(model.jnt_type[i]), int(model.jnt_qposadr[i])
            name = names[i]
            if kind in (MUJOCO_SLIDE, MUJOCO_HINGE):
                most = math.pi if kind == MUJOCO_HINGE else SLIDE_M
                readings[name] = data.qpos[start] = chance.uniform(-most, most)
            elif kind == MUJOCO_BALL:
                quat = chance.normal(size=4)
                data.qpos[start : start + 4] = quat / np.linalg.norm(quat)
                readings |= {f"{name}/rot_{c}": float(v) for c, v in zip("wxyz", quat, strict=True)}
        mujoco.mj_kinematics(model, data)
        world = {name: _matrix(data.xmat[i].reshape(3, 3), data.xpos[i]) for name, i in compared.items()}
        back = np.linalg.inv(_matrix(data.xmat[root].reshape(3, 3), data.xpos[root]))
        worst.add_configuration(
            compute_link_poses(manifest, readings), {name: back @ pose for name, pose in world.items()}
        )
    return worst


def compare_with_pinocchio(manifest: Manifest, urdf: str, seed: int) -> Worst:
    """Compare a body built from URDF with Pinocchio's kinematics of the same text. Mimic joints get their own
    reading, like all others."""
    import pinocchio  # noqa: PLC0415 - it may not be installed

    model = pinocchio.buildModelFromXML(urdf)
    data = model.createData()
    root = manifest["links"][0]
    bodies = {frame.name: i for i, frame in enumerate(model.frames) if frame.type == pinocchio.FrameType.BODY}
    compared = {name: bodies[name] for name in manifest["links"] if name in bodies}
    chance = np.random.default_rng(seed)
    worst = Worst()
    for _ in range(CONFIGURATIONS):
        q = pinocchio.neutral(model)
        readings: dict[str, float] = {}
        for joint in manifest["joints"]:
            name, kind = joint["name"], joint["type"]
            if kind == "fixed" or not model.existJointName(name):
                continue
            start, values = model.joints[model.getJointId(name)].idx_q, _choose(kind, chance)
            readings |= dict(zip((v for v, _ in list_variables(name, kind)), values, strict=True))
            written = _write(kind, values)
            q[start : start + len(written)] = written
        pinocchio.framesForwardKinematics(model, data, q)
        back = data.oMf[bodies[root]].inverse().homogeneous
        worst.add_configuration(
            compute_link_poses(manifest, readings),
            {name: back @ data.oMf[i].homogeneous for name, i in compared.items()},
        )
    return worst


def _choose(kind: str, chance: np.random.Generator) -> list[float]:
    """The joint's variables, in rad and m."""
    if kind == "floating":
        quat = chance.normal(size=4)
        return [*chance.uniform(-SLIDE_M, SLIDE_M, 3), *(quat / np.linalg.norm(quat))]
    if kind == "planar":
        return [*chance.uniform(-SLIDE_M, SLIDE_M, 2), chance.uniform(-math.pi, math.pi)]
    most = SLIDE_M if kind == "prismatic" else math.pi
    return [float(chance.uniform(-most, most))]


def _write(kind: str, values: Sequence[float]) -> list[float]:
    """The same in Pinocchio's configuration, which stores an unlimited angle as its cosine and sine."""
    if kind in ("continuous", "planar"):
        return [*values[:-1], math.cos(values[-1]), math.sin(values[-1])]
    return list(values)


def _matrix(turn: Matrix, place: Matrix) -> Matrix:
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = turn, place
    return whole
