"""Loads a MuJoCo model, adds servos if it has none, simulates its motion, and reads its state as fields."""

from __future__ import annotations

import io
import logging
import math
import os
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

from posecast_edge.kit import SAY_EVERY_S, RateLimitedLog
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.mjcf.assets import FAILURES
from posecast_edge.model.mjcf.bodies import (
    BALL,
    FREE,
    find_base_joint,
    find_driven_bodies,
    find_soft_bodies,
    find_trees,
)
from posecast_edge.model.mjcf.child import open_no_file
from posecast_edge.model.mjcf.compiler import explain_failure, make_spec, name_joints
from posecast_edge.model.mjcf.files import ModelFiles, collect_files
from posecast_edge.model.text import read_robot_text
from posecast_edge.model.urdf.reader import DEPTH_MAX, ELEMENTS_MAX, read_urdf
from posecast_edge.model.urdf.resolver import list_package_folders, read_bounded
from posecast_edge.model.urdf.types import Urdf
from posecast_edge.model.urdf.xml_tree import Element, parse_xml
from posecast_edge.sample import Reading, Sample, SourceError

log = logging.getLogger("posecast_edge.mujoco")
# otherwise MuJoCo writes a file MUJOCO_LOG.TXT into the current folder
mujoco.set_mju_user_warning(lambda text: log.debug("%s", text))

FILE_MAX = 64 << 20  # bytes
STEP_S = (1e-5, 0.1)  # shortest and longest timestep
ROTOR = 0.5  # the motor's inertia behind its gear, as a share of the inertia that the joint carries
SERVO_HZ = 8.0  # natural frequency of the servos added to a model without any, critically damped
TURN_S = 3.0  # one joint, there and back
GO_S, STAY_S = 1.5, 1.0  # from keyframe to keyframe, and at each
FORCE_LEAST = 1e-6  # N or N·m: anything less counts as no force
SWING = 0.45  # of a joint's range, at most
HINGE, SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
SWING_MOST = {HINGE: 0.5, SLIDE: 0.05}  # rad, m
# what a floating joint's readings are called; a quaternion in MuJoCo's order
TRANS = tuple(f"trans_{c}" for c in "xyz")
ROT = tuple(f"rot_{c}" for c in "wxyz")

# kind of sensor → field, names of its values
SENSORS = {
    int(mujoco.mjtSensor.mjSENS_ACCELEROMETER): ("acc", ("x", "y", "z")),
    int(mujoco.mjtSensor.mjSENS_GYRO): ("gyro", ("x", "y", "z")),
    int(mujoco.mjtSensor.mjSENS_FRAMEQUAT): ("quat", ("w", "x", "y", "z")),
    int(mujoco.mjtSensor.mjSENS_FORCE): ("ftf", ("fx", "fy", "fz")),
    int(mujoco.mjtSensor.mjSENS_TORQUE): ("ftm", ("mx", "my", "mz")),
}

# The parts of a URDF passed to MuJoCo: those that affect motion. Mesh formats may be unknown to it.
URDF_KEPT = [
    "link",
    "inertial",
    "mass",
    "inertia",
    "joint",
    "origin",
    "parent",
    "child",
    "axis",
    "limit",
    "dynamics",
]
COMPILER = '<mujoco><compiler boundmass="0.001" boundinertia="0.000001" balanceinertia="true"/></mujoco>'


def load_simulation(path: Path) -> Simulation:
    """Read MJCF or URDF, and only files that belong to the model (model/mjcf/files.py). Raises SourceError
    (one line) when that fails."""
    files = ModelFiles(str(path))
    try:
        content = read_bounded(path, FILE_MAX)
        if path.suffix.lower() == ".urdf" or b"<robot" in content:
            urdf = read_urdf(io.BytesIO(content))
            spec = mujoco.MjSpec.from_string(strip_visuals(content))
            _follow(spec, urdf)
            simulation = _simulate(spec, None, path)
        else:
            files = collect_files(path, list_package_folders(os.environ))
            with open_no_file():
                spec, vfs = make_spec(files)
                simulation = _simulate(spec, vfs, path)
    except (ModelRefused, *FAILURES) as e:
        refused = e if isinstance(e, ModelRefused) else explain_failure(e, files)
        line = "" if refused.line is None else f":{refused.line}"
        raise SourceError(f"{path}{line}: {refused.reason}") from None
    if not simulation.moves:
        raise SourceError(f"{path}: the model has no joint that moves")
    return simulation


def _simulate(spec: Any, vfs: Any, path: Path) -> Simulation:
    warnings.filterwarnings("ignore", "flex '")  # MuJoCo's doubts about a soft part, which is not shown
    if not STEP_S[0] <= spec.option.timestep <= STEP_S[1]:
        least_s, most_s = STEP_S
        raise SourceError(
            f"{path}: the timestep is {spec.option.timestep:g} s; it must be {least_s:g} to {most_s:g}"
        )
    model = spec.compile(vfs)
    soft = find_soft_bodies(model)
    parents, kinds, bodies = (
        getattr(model, name).tolist() for name in ("body_parentid", "jnt_type", "jnt_bodyid")
    )
    base = find_base_joint(parents, kinds, bodies, soft, find_driven_bodies(model))  # before there are servos
    if not spec.actuators:
        _add_servos(spec, model, soft)
        model = spec.compile(vfs)
    return Simulation(model, soft, base)


def strip_visuals(urdf: bytes) -> str:
    """The URDF reduced to masses and joints. Raises ModelRefused."""
    root = parse_xml(read_robot_text(urdf), elements_max=ELEMENTS_MAX, depth_max=DEPTH_MAX)

    def text(element: Element) -> Iterator[str]:
        attributes = "".join(f" {name}={quoteattr(value)}" for name, value in element.attributes.items())
        yield f"<{element.tag}{attributes}>"
        for child in element.children:
            if child.tag in URDF_KEPT:
                yield from text(child)
        yield f"</{element.tag}>"

    head, *rest = text(root)
    return head + COMPILER + "".join(rest)


def _follow(spec: Any, urdf: Urdf) -> None:
    """Tie each mimic joint to the joint that it follows."""
    known = {joint.name for joint in spec.joints}
    for joint in urdf.joints:
        if joint.mimic is not None and {joint.name, joint.mimic.joint} <= known:
            tie = spec.add_equality()
            tie.type, tie.objtype = mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtObj.mjOBJ_JOINT
            tie.name1, tie.name2 = joint.name, joint.mimic.joint
            tie.data[:5] = [joint.mimic.offset, joint.mimic.multiplier, 0, 0, 0]


def _add_servos(spec: Any, model: Any, soft: Sequence[int]) -> None:
    """Add a position servo to each joint that follows no other, strong enough for the load. For what does not
    move freely, gravity is compensated separately. `model`: the compiled spec; `soft`: see
    find_soft_bodies."""
    names = name_joints(model, soft, actuated=False)
    rigid = [joint for joint in spec.joints if names[joint.id]]
    for joint in rigid:
        joint.name = names[joint.id]
    tied = {tie.name1 for tie in spec.equalities if tie.type == mujoco.mjtEq.mjEQ_JOINT}
    omega = 2 * math.pi * SERVO_HZ
    spec.option.integrator = (
        mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    )  # keeps stiff servos on light fingers stable
    tops = find_trees(model.body_parentid.tolist())
    free = {tops[body] for body in model.jnt_bodyid[model.jnt_type == FREE].tolist()}
    for body in spec.bodies:
        if tops[body.id] not in free and not soft[body.id]:
            body.gravcomp = 1.0
    for joint in rigid:
        if int(joint.type) not in SWING_MOST or joint.name in tied:
            continue
        carried = float(model.dof_M0[model.jnt_dofadr[joint.id]])
        joint.armature = float(joint.armature) + ROTOR * carried
        inertia = (1 + ROTOR) * carried
        stiffness, damping = inertia * omega**2, 2 * inertia * omega
        servo = spec.add_actuator(name=f"servo of {joint.name}", target=joint.name)
        servo.trntype = mujoco.mjtTrn.mjTRN_JOINT
        servo.gaintype, servo.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        servo.gainprm[0] = stiffness
        servo.biasprm[:3] = [0, -stiffness, -damping]


@dataclass(frozen=True)
class Servo:
    """A servo that holds a joint at its target. `home`: target at the start; `swing`: largest deviation from
    it."""

    actuator: int
    joint: str
    gear: float
    home: float
    swing: float


class Simulation:
    """One model and its current state. Not thread-safe."""

    def __init__(self, model: Any, soft: Sequence[int], base: int | None) -> None:
        """`soft`: see find_soft_bodies; `base`: see find_base_joint."""
        self._model = model
        self._data = mujoco.MjData(model)
        names = name_joints(model, soft, actuated=True)
        kinds = model.jnt_type.tolist()
        self.joints = {name: i for i, name in enumerate(names) if name and kinds[i] in SWING_MOST}
        self._free = base
        tops = find_trees(model.body_parentid.tolist())
        shown = None if base is None else tops[int(model.jnt_bodyid[base])]  # nothing beside a free robot
        self._floating = {
            name: i
            for i, name in enumerate(names)
            if name and kinds[i] in (FREE, BALL) and i != base
            if shown in (None, tops[int(model.jnt_bodyid[i])])
        }
        self._sliding = frozenset(name for name, i in self.joints.items() if kinds[i] == SLIDE)
        self._sensors = list(_sensors(model))
        self._unstable = RateLimitedLog(log.warning, "times", SAY_EVERY_S)
        self._resets_s = 0.0  # simulated time before a reset
        self._reset()
        self.servos = list(self._find_servos())
        self._programme = self._keyframes if self._has_programme() else self._one_by_one
        self._programme(0.0)
        mujoco.mj_forward(model, self._data)

    @property
    def moves(self) -> bool:
        """Whether it has joints."""
        return bool(self.joints or self._floating) or self._free is not None

    @property
    def t_s(self) -> float:
        """Simulated time in seconds; it continues when an unstable simulation is restarted."""
        return self._resets_s + float(self._data.time)

    def advance(self, seconds: float) -> None:
        """Simulate `seconds` more."""
        steps = max(1, round(seconds / self._model.opt.timestep))
        for _ in range(steps):
            before_s = self._data.time
            self._programme(self.t_s)
            mujoco.mj_step(self._model, self._data)
            if self._data.time <= before_s:  # MuJoCo resets itself when a value becomes NaN
                self._resets_s += before_s
                self._reset()
                text = f"the simulation became unstable at {self.t_s:.2f} s and was restarted"
                self._unstable.add(text, time.monotonic())

    def explain_rest(self) -> str:
        """Why a model does not move on its own: one line, "" if servos or keyframes move it. Call it before
        the first step."""
        model, data = self._model, self._data
        holds = model.actuator_biastype != mujoco.mjtBias.mjBIAS_NONE
        if not model.nu or holds.any() or self._has_programme():
            return ""
        pulled = abs(data.qfrc_bias - data.qfrc_passive).max() > FORCE_LEAST
        does = "falls" if pulled else "stands still"
        return f"this model's actuators are motors: with no controller it {does}"

    def make_sample(self) -> Sample:
        """The current state as a sample."""
        model, data = self._model, self._data
        position: dict[str, Reading] = {}
        speed: dict[str, Reading] = {}
        force: dict[str, Reading] = {}
        for name, i in self.joints.items():
            position[name] = float(data.qpos[model.jnt_qposadr[i]])
            speed[name] = float(data.qvel[model.jnt_dofadr[i]])
            force[name] = float(data.qfrc_actuator[model.jnt_dofadr[i]])
        for name, i in self._floating.items():
            position |= self._read_floating(name, i)
        values: dict[str, dict[str, Reading]] = {}
        if self.servos:
            values["ref"] = {s.joint: float(data.ctrl[s.actuator]) / s.gear for s in self.servos}
        known = {"pos": position, "vel": speed, "effort": force}
        values |= {name: readings for name, readings in known.items() if readings}
        if self._free is not None:
            start = model.jnt_qposadr[self._free]
            values["base"] = _labelled("base", "xyz", data.qpos[start : start + 3])
            values["baseq"] = _labelled("base", "wxyz", data.qpos[start + 3 : start + 7])
        for sensor in self._sensors:
            read = data.sensordata[sensor.start : sensor.start + len(sensor.parts)]
            values.setdefault(sensor.field, {}).update(_labelled(sensor.site, sensor.parts, read))
        links = {s.site: s.link for s in self._sensors}
        return Sample(self.t_s, values, links=links, sliding=self._sliding)

    def _read_floating(self, name: str, i: int) -> dict[str, Reading]:
        """A free joint's motion from its reference pose, from which the shown model starts; a ball's turn."""
        start, free = self._model.jnt_qposadr[i], int(self._model.jnt_type[i]) == FREE
        turned = self._data.qpos[start + 3 * free : start + 3 * free + 4].copy()
        if not free:
            return _floating(name, ROT, turned)
        here, there = self._model.qpos0[start : start + 7], self._data.qpos[start : start + 3]
        back, moved = np.zeros(4), np.zeros(3)
        mujoco.mju_negQuat(back, here[3:])
        mujoco.mju_rotVecQuat(moved, there - here[:3], back)
        mujoco.mju_mulQuat(turned, back, turned.copy())
        return _floating(name, TRANS, moved) | _floating(name, ROT, turned)

    def _reset(self) -> None:
        """Reset to the first keyframe, if there is one."""
        mujoco.mj_resetData(self._model, self._data)
        if self._model.nkey:
            mujoco.mj_resetDataKeyframe(self._model, self._data, 0)
            self._data.time = 0.0

    def _find_servos(self) -> Iterator[Servo]:
        """Actuators whose force is proportional to the distance from their target."""
        model = self._model
        names = {i: name for name, i in self.joints.items()}
        for k in range(model.nu):
            i = int(model.actuator_trnid[k, 0])
            joint = names.get(i)
            gain, bias, gear = (
                model.actuator_gainprm[k, 0],
                model.actuator_biasprm[k, 1],
                model.actuator_gear[k, 0],
            )
            if model.actuator_trntype[k] != mujoco.mjtTrn.mjTRN_JOINT or joint is None:
                continue
            if gain <= 0 or not math.isclose(gain, -bias) or gear == 0:
                continue
            low, high = model.jnt_range[i] if model.jnt_limited[i] else (-math.inf, math.inf)
            home = min(max(float(self._data.qpos[model.jnt_qposadr[i]]), low), high)
            swing = min(SWING_MOST[int(model.jnt_type[i])], SWING * (high - low))
            if home + swing > high:  # there is more room on the other side
                swing = -swing
            yield Servo(k, joint, float(gear), home, float(swing))

    def _has_programme(self) -> bool:
        keys = self._model.key_ctrl
        return self._model.nkey > 1 and bool((keys != keys[0]).any())

    def _keyframes(self, t_s: float) -> None:
        """Move smoothly from keyframe to keyframe, with a rest at each."""
        keys = self._model.key_ctrl
        leg, within_s = divmod(t_s, GO_S + STAY_S)
        start, end = keys[int(leg) % len(keys)], keys[(int(leg) + 1) % len(keys)]
        share = min(within_s / GO_S, 1.0)
        self._data.ctrl[:] = start + (end - start) * (1 - math.cos(math.pi * share)) / 2

    def _one_by_one(self, t_s: float) -> None:
        """Move one servo after the other, there and back."""
        turn, within_s = divmod(t_s, TURN_S)
        for i, servo in enumerate(self.servos):
            away = (
                (1 - math.cos(2 * math.pi * within_s / TURN_S)) / 2
                if i == int(turn) % len(self.servos)
                else 0.0
            )
            self._data.ctrl[servo.actuator] = (servo.home + away * servo.swing) * servo.gear


@dataclass(frozen=True)
class SiteSensor:
    """Where the values of one sensor are stored and what they mean."""

    field: str
    site: str
    parts: tuple[str, ...]
    start: int
    link: str


def _sensors(model: Any) -> Iterator[SiteSensor]:
    for i in range(model.nsensor):
        known = SENSORS.get(int(model.sensor_type[i]))
        if known is None:
            continue
        field, parts = known
        kind, of = int(model.sensor_objtype[i]), int(model.sensor_objid[i])
        if kind == mujoco.mjtObj.mjOBJ_SITE:
            site, body = _name(model, "site", of), int(model.site_bodyid[of])
        else:
            site, body = _name(model, "sensor", i), of
        yield SiteSensor(
            field, site.replace(".", "_"), parts, int(model.sensor_adr[i]), _name(model, "body", body)
        )


def _name(model: Any, kind: str, i: int) -> str:
    """The name of site, sensor or body `i`."""
    objects: dict[str, Callable[[int], Any]] = {
        "site": model.site,
        "sensor": model.sensor,
        "body": model.body,
    }
    return str(objects[kind](i).name) or f"{kind}{i}"


def _floating(joint: str, parts: Sequence[str], numbers: Any) -> dict[str, Reading]:
    return {f"{joint}/{part}": float(number) for part, number in zip(parts, numbers, strict=True)}


def _labelled(site: str, parts: Any, numbers: Any) -> dict[str, Reading]:
    return {f"{site}.{part}": float(number) for part, number in zip(parts, numbers, strict=True)}
