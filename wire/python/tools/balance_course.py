"""A robot whose feet are pushed at chosen points, frame by frame: its codes, and its balance."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from posecast_wire.schema import CODE_MAX, MISSING, Schema, build_schema_text

from wire.python.tools.balance_geometry import (
    Array,
    Document,
    homogeneous,
    hull_of,
    margin_in,
    place_links,
    quat_rotation,
    rotation_of_rpy,
    twist_of,
)

GRAVITY = 9.81
SMOOTHED_S = 0.1
GAP_S = 0.75
EDGE_M = 0.005
OUTSIDE_M = 0.2
AXES = "xyz"

LINKS = ["trunk", "head", "rthigh", "rshin", "rfoot", "rsole", "lthigh", "lshin", "lfoot", "lsole"]
LEGS = (("r", -0.1, 2), ("l", 0.1, 6))
SOLE = [[-0.08, -0.045, -0.03], [0.13, -0.05, -0.03], [0.16, 0.0, -0.03], [0.13, 0.05, -0.03]]
SOLE += [[-0.08, 0.045, -0.03]]
MASSES = {"trunk": 22.5, "head": 3.1, "rthigh": 4.2, "rshin": 2.6, "rfoot": 1.1}
MASSES |= {"lthigh": 4.2, "lshin": 2.6, "lfoot": 1.1}
WEIGHT_N = sum(MASSES.values()) * GRAVITY
SENSORS: Document = {
    "RF": {"kind": "wrench", "name": "right foot", "link": "rfoot", "xyz": [0.01, 0.0, 0.02]},
    "LF": {"kind": "wrench", "name": "left foot", "link": "lfoot", "xyz": [0.01, 0.0, 0.02]},
}
ALL = ("fx", "fy", "fz", "mx", "my", "mz")


def make_model() -> Document:
    """A trunk with a head on two legs of hip, knee and ankle. The soles are on links of their own."""
    joints: list[Document] = [
        {"name": "neck", "type": "revolute", "parent": 0, "xyz": [0, 0, 0.45], "axis": [0, 0, 1]}
    ]
    for side, y, thigh in LEGS:
        joints += [
            {"name": f"{side}hip", "type": "revolute", "parent": 0, "xyz": [0, y, -0.05], "axis": [0, 1, 0]},
            {"name": f"{side}knee", "type": "revolute", "parent": thigh, "xyz": [0.01, 0, -0.35]},
            {"name": f"{side}ankle", "type": "revolute", "parent": thigh + 1, "xyz": [-0.01, 0, -0.35]},
            {"name": f"{side}weld", "type": "fixed", "parent": thigh + 2, "xyz": [0.02, 0, -0.03]},
        ]
        joints[-3]["axis"], joints[-2]["axis"] = [0, 1, 0], [0.6, 0.8, 0]
        half = math.sqrt(0.5)  # turned a quarter about z, so that its axes are not the foot's
        joints[-1]["quat"] = [half, 0, 0, half]
    joints = [{**joint, "child": i + 1} for i, joint in enumerate(joints)]
    dice = random.Random("masses")
    inertials: list[Document] = [
        {
            "link": LINKS.index(link),
            "mass_kg": mass,
            "xyz": [round(dice.uniform(-0.03, 0.03), 3), round(dice.uniform(-0.03, 0.03), 3), -0.1],
            "inertia": [0.01, 0, 0, 0.01, 0, 0.01],
        }
        for link, mass in MASSES.items()
    ]
    inertials.sort(key=lambda one: int(one["link"]))
    quarter = [[y, -x, z] for x, y, z in SOLE]  # the same points in the welded link's axes
    soles = [{"link": LINKS.index(link), "points": quarter} for link in ("rsole", "lsole")]
    boxes = [{"link": soles[i]["link"], "source": "", "box": [*_box(quarter)]} for i in (0, 1)]
    return {
        "v": 2,
        "robot": "made-up",
        "files": [],
        "levels": [],
        "links": LINKS,
        "joints": joints,
        "visuals": boxes,
        "findings": [],
        "inertials": inertials,
        "soles": soles,
    }


def _box(points: Sequence[Sequence[float]]) -> tuple[list[float], list[float]]:
    columns = list(zip(*points, strict=True))
    return [min(c) for c in columns], [max(c) for c in columns]


@dataclass
class Push:
    """How the floor pushes against a sole: points as weights of its corners, each with a force (N, link's
    axes: the normal is z). `None` in a frame instead of it: no reading."""

    points: list[list[float]]
    forces: list[list[float]]


@dataclass
class Frame:
    """One frame, and what is known of it beforehand."""

    t: float
    joints: Mapping[str, float]
    pushes: Mapping[str, Push | None]
    bears: Mapping[str, bool | None]
    base: tuple[Sequence[float], Sequence[float]] | None = None  # xyz; roll, pitch, yaw
    tilt: tuple[float, float] | None = None
    gaps: Mapping[str, str] = field(default_factory=dict)
    lost: Sequence[str] = ()  # channels without a reading though there is a push
    full: Sequence[str] = ()  # channels at the limit of their code: no reading either
    zero: Sequence[str] = ()  # channels whose code is 0
    blind: str | None = None  # why nobody knows where the links are


@dataclass
class Case:
    """A course of frames of one robot."""

    name: str
    frames: list[Frame]
    model: str = "biped"
    ground: str | None = "measured"
    components: Sequence[str] = ALL
    sensors: Mapping[str, Any] = field(default_factory=lambda: SENSORS)
    rule: Mapping[str, Any] | None = None
    sign: int = 1  # -1: the sensor tells the force of the foot on the floor
    feet: Mapping[str, str] = field(default_factory=lambda: {"RF": "rsole", "LF": "lsole"})
    soles: Mapping[str, Any] = field(default_factory=dict)  # of the profile
    placed_by: str = "base"
    # by field or channel ("ftf RF.fx"), its unit and what one of it is in N or N·m (0: nobody knows)
    units: Mapping[str, tuple[str, float]] = field(default_factory=dict)

    def find_unit(self, name: str, label: str) -> tuple[str, float]:
        """The unit of a channel and its worth."""
        return self.units.get(f"{name} {label}") or self.units.get(name, ("", 1.0))


def make_schema(case: Case) -> str:
    """Fields: joints, wrenches, and how the root is placed."""
    joints = [f"{side}{joint}" for side in "rl" for joint in ("hip", "knee", "ankle")]
    labels: dict[str, list[str]] = {"joint": ["neck", *joints]}
    fields: list[Document] = [{"name": "pos", "labels": "joint", "scale": 0.0001}]

    def add(name: str, of: list[str], scale: float) -> None:
        if of:
            labels[name] = of
            unit, worth = case.units.get(name, ("", 1.0))
            step = scale / worth if worth else scale
            fields.append({"name": name, "labels": name, "unit": unit, "scale": step})

    for name, first in (("ftf", "f"), ("ftm", "m")):
        parts = [part for part in case.components if part[0] == first]
        add(name, [f"{site}.{part}" for site in case.sensors if site != "imu" for part in parts], 0.0001)
    if case.placed_by == "base":
        add("base", [f"base.{part}" for part in AXES], 0.0001)
        add("baseq", [f"base.{part}" for part in "wxyz"], 1e-6)
    elif case.placed_by == "tilt":
        add("tilt", ["imu.roll", "imu.pitch"], 0.0001)
    mapping: Document = {"sensors": dict(case.sensors)}
    for channel, (unit, _) in case.units.items():
        name, _, label = channel.partition(" ")
        if label:
            mapping.setdefault("units", {}).setdefault(name, {})[label] = unit
    if case.rule is not None:
        mapping["balance"] = dict(case.rule)
    return build_schema_text("made-up", labels, fields, mapping)


class Course:
    """What goes on from frame to frame: codes are made, and what they mean is computed."""

    def __init__(self, case: Case, model: Document) -> None:
        self.case, self.model = case, model
        self.schema = Schema.parse(make_schema(case))
        self._before: Document | None = None
        self._velocity: Array | None = None
        corners = {s["link"]: s["points"] for s in model.get("soles", [])}
        self.soles = {}
        for foot, link in case.feet.items():
            points = case.soles.get(foot) or corners[LINKS.index(link)]
            self.soles[foot] = np.array(points, dtype=float)

    def make(self, frame: Frame) -> Document:
        """Codes and balance of the next frame."""
        readings = self._codes_of_pose(frame)
        codes, values = readings
        world_from_root = self._root(frame, values)
        links = place_links(
            self.model, {k[4:]: v for k, v in values.items() if k[:4] == "pos "}, world_from_root
        )
        codes |= self._wrenches(frame, links)
        row = []
        for f in self.schema.fields:
            for label in f.labels:
                code = CODE_MAX if label in frame.full else codes.get(f"{f.name} {label}", MISSING)
                code = 0 if label in frame.zero else code
                row.append(MISSING if label in frame.lost else code)
        return {"t": frame.t, "codes": row, "balance": self._balance(frame, links)}

    def _codes_of_pose(self, frame: Frame) -> tuple[dict[str, int], dict[str, float]]:
        wanted = {f"pos {joint}": value for joint, value in frame.joints.items()}
        if frame.base is not None:
            xyz, rpy = frame.base
            turn = rotation_of_rpy(rpy)
            w = math.sqrt(max(0.0, 1 + np.trace(turn))) / 2
            quat = [w, turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
            quat[1:] = [part / (4 * w) for part in quat[1:]]
            wanted |= {f"base base.{a}": v for a, v in zip(AXES, xyz, strict=True)}
            wanted |= {f"baseq base.{a}": v for a, v in zip("wxyz", quat, strict=True)}
        if frame.tilt is not None:
            wanted |= {f"tilt imu.{a}": v for a, v in zip(("roll", "pitch"), frame.tilt, strict=True)}
        codes: dict[str, int] = {}
        values: dict[str, float] = {}
        for name, value in wanted.items():
            scale = next(f.scale for f in self.schema.fields if f.name == name.split(" ")[0])
            codes[name] = round(value / scale)
            values[name] = codes[name] * scale
        return codes, values

    def _root(self, frame: Frame, values: Mapping[str, float]) -> Array:
        if frame.base is not None:
            quat = np.array([values[f"baseq base.{a}"] for a in "wxyz"])
            quat = quat / np.linalg.norm(quat)
            return homogeneous(quat_rotation(quat), [values[f"base base.{a}"] for a in AXES])
        turn = np.eye(3)
        if frame.tilt is not None:  # the IMU is on the trunk, the root
            turn = rotation_of_rpy([values["tilt imu.roll"], values["tilt imu.pitch"], 0])
            turn = twist_of(turn).T @ turn  # which has no heading
        joints = {k[4:]: v for k, v in values.items() if k[:4] == "pos "}
        links = place_links(self.model, joints, homogeneous(turn, [0, 0, 0]))
        low = math.inf
        for visual in self.model["visuals"]:
            (x, y, z), (u, v, w) = visual["box"]
            corners = np.array([[a, b, c, 1] for a in (x, u) for b in (y, v) for c in (z, w)])
            low = min(low, float((links[visual["link"]] @ corners.T)[2].min()))
        return homogeneous(turn, [0, 0, -low])

    def _wrenches(self, frame: Frame, links: Sequence[Array]) -> dict[str, int]:
        """The sum of the pushes at each sensor."""
        codes: dict[str, int] = {}
        for foot, push in frame.pushes.items():
            if push is None:
                continue
            sole_link = links[LINKS.index(self.case.feet[foot])]
            mount = self.case.sensors[foot]
            sensor = links[LINKS.index(mount["link"])] @ homogeneous(
                rotation_of_rpy(mount.get("rpy", [0, 0, 0])), mount["xyz"]
            )
            total = np.zeros(6)
            for weights, force in zip(push.points, push.forces, strict=True):
                point = sole_link[:3, :3] @ (np.array(weights) @ self.soles[foot]) + sole_link[:3, 3]
                f = sensor[:3, :3].T @ sole_link[:3, :3] @ np.array(force)
                r = sensor[:3, :3].T @ (point - sensor[:3, 3])
                total += [*f, *np.cross(r, f)]
            for part, value in zip(ALL, self.case.sign * total, strict=True):
                if part in self.case.components:
                    name, label = f"ft{part[0]}", f"{foot}.{part}"
                    scale = next(f.scale for f in self.schema.fields if f.name == name)
                    worth = self.case.find_unit(name, label)[1] or 1.0
                    codes[f"{name} {label}"] = round(value / worth / scale)
        return codes

    def _balance(self, frame: Frame, links: Sequence[Array]) -> Document:
        case, gaps = self.case, dict(frame.gaps)
        is_known = frame.blind is not None or "centre_of_mass" not in gaps
        masses = (self.model.get("inertials") or []) if is_known else []
        total = sum(m["mass_kg"] for m in masses)
        centre = None
        if masses and frame.blind is None:
            centre = sum(m["mass_kg"] * (links[m["link"]] @ [*m["xyz"], 1])[:3] for m in masses) / total
        feet = {foot: self._foot(frame, foot, links) for foot in case.feet}
        bearing = [feet[foot]["corners"] for foot, bears in frame.bears.items() if bears]
        found: Document = {
            "mass_kg": total,
            "centre_of_mass_m": centre,
            "ground": case.ground,
            "floor_m": None,
            "support_polygon_m": [],
            "margin_m": None,
            "nearest_edge": None,
            "centre_of_pressure_m": None,
        }
        if "polygon" not in gaps:
            corners = [corner for foot in bearing for corner in foot]
            found["floor_m"] = min(float(corner[2]) for corner in corners)
            found["support_polygon_m"] = hull_of(corners)
            if centre is not None:
                found["margin_m"], found["nearest_edge"] = margin_in(found["support_polygon_m"], centre[:2])
        if "pressure" not in gaps:
            pressed = [foot for foot in feet.values() if foot["pushed_at"] is not None]
            force = sum(foot["force_n"] for foot in pressed)
            mean = sum(foot["force_n"] * foot["pushed_at"] for foot in pressed) / force
            found["centre_of_pressure_m"] = [mean[0], mean[1], found["floor_m"]]
        found["velocity_mps"] = self._velocity_of(frame, centre, feet, links)
        ahead = None
        if found["velocity_mps"] is not None and found["floor_m"] is not None and centre is not None:
            ahead = centre + found["velocity_mps"] * math.sqrt((centre[2] - found["floor_m"]) / GRAVITY)
            ahead[2] = found["floor_m"]
        found["capture_point_m"] = ahead
        for foot in feet.values():
            del foot["corners"], foot["pushed_at"]
        return found | {"feet": feet, "gaps": gaps}

    def _foot(self, frame: Frame, foot: str, links: Sequence[Array]) -> Document:
        link = links[LINKS.index(self.case.feet[foot])]
        in_world = [(link @ [*corner, 1])[:3] for corner in self.soles[foot]]
        push, bears, unread = frame.pushes.get(foot), frame.bears[foot], [*frame.lost, *frame.full]
        nothing: Document = {"bears": bears, "force_n": None, "centre_of_pressure_m": None, "at_edge": False}
        nothing |= {"corners": in_world, "pushed_at": None}
        if push is None or any(label.startswith(f"{foot}.f") for label in unread):
            return nothing
        normal = [force[2] for force in push.forces]
        nothing["force_n"] = abs(sum(normal))
        known = {
            part for part in self.case.components if self.case.find_unit(f"ft{part[0]}", f"{foot}.{part}")[1]
        }
        whole = {"mx", "my"} <= known
        if any(label.startswith(f"{foot}.m") for label in unread) or not whole or nothing["force_n"] == 0:
            return nothing
        weights = sum(n * np.array(p) for n, p in zip(normal, push.points, strict=True)) / sum(normal)
        local = weights @ self.soles[foot]
        polygon = hull_of([corner[:2] for corner in self.soles[foot]])
        inside_m = margin_in(polygon, local[:2])[0]
        if inside_m < -OUTSIDE_M:
            return nothing
        nothing["pushed_at"] = (link @ [*local, 1])[:3]
        if not bears or nothing["force_n"] < 0.03 * (WEIGHT_N if self.model.get("inertials") else 400):
            return nothing
        nothing["centre_of_pressure_m"] = nothing["pushed_at"]
        nothing["at_edge"] = inside_m < EDGE_M
        return nothing

    def _velocity_of(
        self, frame: Frame, centre: Array | None, feet: Mapping[str, Document], links: Sequence[Array]
    ) -> Array | None:
        before = self._before
        if before is not None and not 0 <= frame.t - before["t"] <= GAP_S:
            before = self._before = self._velocity = None
        if centre is None or any(bears is None for bears in frame.bears.values()):
            return None
        now: Document = {"t": frame.t, "centre": centre, "bears": frame.bears, "links": links}
        self._before = now
        if before is None:
            self._velocity = None
            return None
        shared = [foot for foot in feet if frame.bears[foot] and before["bears"][foot]]
        if not shared:
            self._velocity = None
            return None
        foot = max(shared, key=lambda name: feet[name]["force_n"] or 0.0)
        index = LINKS.index(self.case.feet[foot])
        turned = links[index][:3, :3] @ before["links"][index][:3, :3].T
        yaw = twist_of(turned)
        middle = [*self.soles[foot].mean(axis=0), 1]
        was, stands = (before["links"][index] @ middle)[:3], (links[index] @ middle)[:3]
        passed = frame.t - before["t"]
        raw = (centre - (stands + yaw @ (before["centre"] - was))) / passed
        if self._velocity is None:
            self._velocity = raw
        else:
            old = yaw @ self._velocity
            self._velocity = old + (1 - math.exp(-passed / SMOOTHED_S)) * (raw - old)
        velocity: Array = self._velocity
        return velocity
