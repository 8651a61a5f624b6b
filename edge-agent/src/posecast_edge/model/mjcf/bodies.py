"""Converts the bodies and joints of a compiled MuJoCo model to links and joints of a tree.

A body's link has the body's frame. In MuJoCo a body may have several joints, each about a point that need not
be its origin. So between two joints, and after a joint about another point, there is a link without a shape.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.finding import Finding, quote_name, quote_names
from posecast_edge.model.kinematics import Matrix, matrix_from_quaternion, multiply, turn_about
from posecast_edge.model.mjcf.compiled import CompiledModel
from posecast_edge.model.sdf.frames import make_pose
from posecast_edge.model.urdf.types import UNBOUNDED, ZERO, Joint, Limit, Mimic, Pose, Vector

FREE, BALL, SLIDE, HINGE = range(4)  # mjtJoint
JOINT_EQUALITY = 2  # mjtEq
TO_JOINT, TO_JOINT_IN_PARENT, TO_CRANK, TO_TENDON, TO_SITE, TO_BODY = range(6)  # mjtTrn
WRAPS_JOINT, WRAPS_SITE = 1, 3  # mjtWrap
WHOLE = (1.0, 0.0, 0.0, 0.0)
SMALL = 1e-9  # m or rad: nothing


@dataclass(frozen=True)
class BodyTree:
    """`links`: name by number of the body, the root first; `between`: names of links that stand for no body;
    `joints`: from parents to children; `root`: the body that is the root, 0 for the world."""

    root: int
    links: dict[int, str]
    between: tuple[str, ...]
    joints: tuple[Joint, ...]
    findings: tuple[Finding, ...]


def find_soft_bodies(model: Any) -> list[int]:
    """Which bodies of a mjModel are only vertices of its soft parts (flex): 1 for each of these. They show
    nothing, nothing drives them, and they do no more than slide."""
    if not model.nflex:
        return [0] * int(model.nbody)
    soft = np.zeros(model.nbody, np.uint8)
    vertices = np.concatenate([model.flex_vertbodyid.reshape(-1), model.flex_nodebodyid.reshape(-1)])
    soft[vertices[vertices > 0]] = 1
    turning = model.jnt_bodyid[model.jnt_type != SLIDE]
    for rigid in (model.geom_bodyid, model.site_bodyid, turning, find_driven_bodies(model)):
        soft[rigid] = 0
    for body in range(model.nbody - 1, 0, -1):  # children come after their parents
        if not soft[body]:
            soft[model.body_parentid[body]] = 0
    found: list[int] = soft.tolist()
    return found


def find_driven_bodies(model: Any) -> list[int]:
    """The bodies of a mjModel on which its actuators act, directly, at a joint or a site, or by a tendon."""
    found: set[int] = set()
    for kind, one in zip(model.actuator_trntype.tolist(), model.actuator_trnid[:, 0].tolist(), strict=True):
        if kind in (TO_JOINT, TO_JOINT_IN_PARENT):
            found.add(int(model.jnt_bodyid[one]))
        elif kind in (TO_SITE, TO_CRANK):
            found.add(int(model.site_bodyid[one]))
        elif kind == TO_BODY:
            found.add(one)
        elif kind == TO_TENDON:
            first = int(model.tendon_adr[one])
            for i in range(first, first + int(model.tendon_num[one])):
                if model.wrap_type[i] in (WRAPS_JOINT, WRAPS_SITE):
                    joint = model.wrap_type[i] == WRAPS_JOINT
                    found.add(int((model.jnt_bodyid if joint else model.site_bodyid)[model.wrap_objid[i]]))
    return sorted(found)


def find_trees(parents: Sequence[int]) -> list[int]:
    """For each body, the first of its tree, which hangs on the world; 0 for the world. `parents`: of the
    bodies."""
    top = [0] * len(parents)
    for body in range(1, len(parents)):  # parents come before their children
        top[body] = body if parents[body] == 0 else top[parents[body]]
    return top


def find_base_joint(
    parents: Sequence[int],
    kinds: Sequence[int],
    bodies: Sequence[int],
    soft: Sequence[int],
    driven: Sequence[int],
) -> int | None:
    """The free joint by which the robot moves in the world; None for a fixed robot. `parents`: of the bodies;
    `kinds`, `bodies`: of the joints; `soft`: 1 for each body that is a vertex of a soft part; `driven`: the
    bodies on which actuators act.

    The robot is the tree with actuators, else that with the most joints; of two with as many, the one
    that moves freely. A free body without other joints, such as a cube, is it only if nothing else moves.
    """
    top = find_trees(parents)
    counts: dict[int, int] = {}
    free: dict[int, int] = {}
    for number, (kind, body) in enumerate(zip(kinds, bodies, strict=True)):
        if not soft[body]:
            counts[top[body]] = counts.get(top[body], 0) + 1
            if kind == FREE:
                free[body] = number
    if not counts:
        return None
    actuated = {top[body] for body in driven}

    def rank(tree: int) -> tuple[bool, bool, int, bool]:
        return tree in actuated, tree not in free or counts[tree] > 1, counts[tree], tree in free

    return free.get(max(counts, key=rank))


def build_body_tree(model: CompiledModel) -> BodyTree:
    """The links and joints of the robot."""
    return _Builder(model).build()


class _Builder:
    def __init__(self, model: CompiledModel) -> None:
        self._model = model
        self._parents = [int(p) for p in model["body_parentid"]]
        self._soft = model["body_soft"].tolist()
        self._kinds = [int(k) for k in model["jnt_type"]]
        self._joint_names = model.names["joint"]
        self._taken_links = set(model.names["body"])
        self._taken_joints = set(self._joint_names)
        self._mimics = dict(self._couplings())
        self._own: dict[int, list[int]] = {}  # joints by body
        for number, body in enumerate(model["jnt_bodyid"].tolist()):
            self._own.setdefault(body, []).append(number)
        self._links: dict[int, str] = {}
        self._between: list[str] = []
        self._joints: list[Joint] = []
        self._findings: list[Finding] = []

    def build(self) -> BodyTree:
        driven = np.flatnonzero(self._model["body_driven"]).tolist()
        bodies = self._model["jnt_bodyid"].tolist()
        base = find_base_joint(self._parents, self._kinds, bodies, self._soft, driven)
        root = 0 if base is None else int(self._model["jnt_bodyid"][base])
        mocap = self._model["body_mocapid"]
        left_out, marks = [], []
        for body, parent in enumerate(self._parents):
            name = self._model.names["body"][body]
            if self._soft[body]:
                continue
            if body == root:
                self._links[body] = name
            elif mocap[body] >= 0:
                marks.append(name)
            elif parent in self._links and body != 0:
                self._links[body] = name
                self._join(body, self._links[parent])
            elif body != 0:
                left_out.append(name)
        if marks:
            self._say("mocap", f"{_list(marks)}: mocap bodies, not part of the robot; not shown")
        if left_out and root != 0:
            text = f"{_list(left_out)}: not joined to {quote_name(self._links[root])}, which moves freely"
            self._say("beside", f"{text}; not shown")
        return BodyTree(root, self._links, tuple(self._between), tuple(self._joints), tuple(self._findings))

    def _say(self, code: str, text: str) -> None:
        self._findings.append(Finding("hint", code, text))

    def _join(self, body: int, parent: str) -> None:
        """All joints between a body's parent and the body."""
        model, name = self._model, self._model.names["body"][body]
        at = matrix_from_quaternion(
            model["body_pos"][body].tolist(), normalise_quaternion(model["body_quat"][body])
        )
        behind: Vector = ZERO  # from the last joint's place to the body's origin, turned round
        own = self._own.get(body, [])
        for number in own:
            kind, place = self._kinds[number], _three(model["jnt_pos"][number])
            axis, start = _three(model["jnt_axis"][number]), int(model["jnt_qposadr"][number])
            reference = model["qpos0"][start : start + 7]
            if kind == FREE:
                at = matrix_from_quaternion(reference[:3].tolist(), normalise_quaternion(reference[3:7]))
                place = ZERO
            elif kind == SLIDE:
                place = ZERO
                at = multiply(at, _shift(_add(behind, axis, -float(reference[0]))))
            else:
                at = multiply(at, _shift(_add(behind, place, 1.0)))
                if kind == HINGE:
                    at = multiply(at, turn_about(ZERO, axis, -float(reference[0])))
            behind = _add(ZERO, place, -1.0)
            last = number == own[-1] and max(map(abs, behind)) < SMALL
            child = name if last else self._link_between(f"{name}/{self._joint_names[number]}")
            self._joints.append(self._joint(number, parent, child, make_pose(at), axis))
            parent, at = child, matrix_from_quaternion(ZERO, WHOLE)
        if parent != name:
            fixed = _free_name(f"{name}_fixed", self._taken_joints)
            pose = make_pose(multiply(at, _shift(behind)))
            line = model.lines["body"][body]
            self._joints.append(Joint(fixed, "fixed", parent, name, pose, None, None, None, line))

    def _link_between(self, wanted: str) -> str:
        name = _free_name(wanted, self._taken_links)
        self._between.append(name)
        return name

    def _joint(self, number: int, parent: str, child: str, pose: Pose, axis: Vector) -> Joint:
        model, kind, line = self._model, self._kinds[number], self._model.lines["joint"][number]
        name = self._joint_names[number]
        if kind in (FREE, BALL):  # a ball is a floating joint whose translation has no readings
            return Joint(name, "floating", parent, child, pose, None, None, None, line)
        limited = bool(model["jnt_limited"][number])
        low, high = model["jnt_range"][number].tolist() if limited else (-UNBOUNDED, UNBOUNDED)
        force = model["jnt_actfrcrange"][number] if model["jnt_actfrclimited"][number] else None
        effort = float(max(abs(force[0]), abs(force[1]))) if force is not None else None
        limit = Limit(low, high, None, effort, line)
        word = "prismatic" if kind == SLIDE else "revolute" if limited else "continuous"
        return Joint(name, word, parent, child, pose, axis, limit, self._mimics.get(number), line)

    def _couplings(self) -> Iterator[tuple[int, Mimic]]:
        """Joints that follow another by a linear equality constraint."""
        model = self._model
        for kind, active, one, other, data in zip(
            model["eq_type"].tolist(),
            model["eq_active0"].tolist(),
            model["eq_obj1id"].tolist(),
            model["eq_obj2id"].tolist(),
            model["eq_data"].tolist(),
            strict=True,
        ):
            if kind != JOINT_EQUALITY or not active or other < 0 or any(data[2:5]):
                continue
            if self._kinds[one] not in (SLIDE, HINGE) or self._kinds[other] not in (SLIDE, HINGE):
                continue
            y, x = (float(model["qpos0"][int(model["jnt_qposadr"][j])]) for j in (one, other))
            # MuJoCo: value − reference of the one = data[0] + data[1] · (value − reference of the other)
            yield (
                one,
                Mimic(
                    self._joint_names[other], data[1], y + data[0] - data[1] * x, model.lines["joint"][one]
                ),
            )


def normalise_quaternion(quat: NDArray[Any]) -> tuple[float, float, float, float]:
    """The unit quaternion (w, x, y, z); no rotation for one without length."""
    w, x, y, z = (float(v) for v in quat)
    length = math.hypot(w, x, y, z)
    return (w / length, x / length, y / length, z / length) if length > SMALL else WHOLE


def _three(values: NDArray[np.float64]) -> Vector:
    x, y, z = (float(v) for v in values)
    return (x, y, z)


def _add(a: Vector, b: Vector, factor: float) -> Vector:
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])


def _shift(xyz: Vector) -> Matrix:
    return matrix_from_quaternion(xyz, WHOLE)


def _free_name(wanted: str, taken: set[str]) -> str:
    name, number = wanted, 1
    while name in taken:
        number += 1
        name = f"{wanted}_{number}"
    taken.add(name)
    return name


def _list(names: Sequence[str]) -> str:
    return f"bod{'ies' if len(names) > 1 else 'y'} {quote_names(names)}"
