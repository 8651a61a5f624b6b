"""A robot whose balance can be told by heart: a trunk of 40 kg on two legs that end in ankles and soles."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from posecast_relay.balance.balance import Balance
from posecast_relay.balance.course import BalanceCourse
from posecast_relay.balance.model import BalanceModel, read_balance_model
from posecast_relay.kinematics.link_poses import FrameReadings, LinkPoses
from posecast_wire import Schema, build_schema_text
from posecast_wire.schema import MISSING

LINKS = ["trunk", "right_foot", "right_sole", "left_foot"]
SOLE = [[0.12, -0.05, 0.0], [0.12, 0.05, 0.0], [-0.08, 0.05, 0.0], [-0.08, -0.05, 0.0]]
SENSORS = {
    site: {"kind": "wrench", "name": site, "link": link, "xyz": [0, 0, 0.1]}
    for site, link in (("RF", "right_foot"), ("LF", "left_foot"))
}
BASE = {"base": ["base.x", "base.y", "base.z"], "baseq": ["base.w", "base.x", "base.y", "base.z"]}
PARTS = {"ftf": ("fx", "fy", "fz"), "ftm": ("mx", "my", "mz")}
LEG_M = 0.8
WEIGHT_N = 40 * 9.81


def make_manifest(**changes: Any) -> dict[str, Any]:
    """Its manifest; a member given as None is left out. The right sole is fixed below the right foot."""
    joints = [
        {"name": "right_leg", "type": "prismatic", "parent": 0, "child": 1, "xyz": [0, -0.1, -LEG_M]},
        {"name": "ankle", "type": "fixed", "parent": 1, "child": 2, "xyz": [0, 0, -0.1]},
        {"name": "left_leg", "type": "prismatic", "parent": 0, "child": 3, "xyz": [0, 0.1, -LEG_M - 0.1]},
    ]
    for joint in joints:
        joint["axis"] = [0, 0, 1]
    inertia = [0.1, 0, 0, 0.1, 0, 0.1]
    manifest = {
        "v": 2,
        "robot": "standing",
        "files": [],
        "levels": [],
        "findings": [],
        "links": LINKS,
        "joints": joints,
        "visuals": [],
        "inertials": [{"link": 0, "mass_kg": 40, "xyz": [0.02, 0, 0.1], "inertia": inertia}],
        "soles": [{"link": 2, "points": SOLE}, {"link": 3, "points": SOLE}],
        **changes,
    }
    return {name: each for name, each in manifest.items() if each is not None}


def make_model(**changes: Any) -> BalanceModel:
    """The same, read."""
    return read_balance_model(json.dumps(make_manifest(**changes)).encode())


def make_schema_text(
    balance: Mapping[str, Any] | None = None,
    sensors: Mapping[str, Any] = SENSORS,
    fields: Sequence[str] = ("pos", "ftf", "ftm", "base", "baseq"),
    unit: str = "N",
) -> str:
    """What it reports: legs, a wrench of each foot, and where its trunk is; with steps of a thousandth."""
    labels = {"joint": ["right_leg", "left_leg"], **BASE}
    for name, parts in PARTS.items():
        labels[name] = [f"{site}.{part}" for site in ("RF", "LF") for part in parts]
    units = {"ftf": unit, "ftm": "N·m"}
    specs = [
        {"name": f, "labels": "joint" if f == "pos" else f, "unit": units.get(f, ""), "scale": 0.001}
        for f in fields
    ]
    used = {name: labels[name] for name in ("joint", *fields) if name in labels}
    mapping: dict[str, Any] = {"sensors": dict(sensors)}
    if balance is not None:
        mapping["balance"] = dict(balance)
    return build_schema_text("standing", used, specs, mapping)


def make_codes(schema: Schema, **values: float | None) -> list[int]:
    """The codes of a frame: upright 0.9 m above the floor, half its weight on each foot; then `values` by
    channel (`.` is `_`, as in `RF_fz` or `base_x`)."""
    told: dict[str, float | None] = {
        "base.z": LEG_M + 0.1,
        "RF.fz": WEIGHT_N / 2,
        "LF.fz": WEIGHT_N / 2,
        **{
            name if name in ("right_leg", "left_leg") else name.replace("_", "."): v
            for name, v in values.items()
        },
    }
    codes: list[int] = []
    for f in schema.fields:
        for label in f.labels:
            value = told.get(label, 0.0)
            if f.name == "baseq":  # upright
                value = 1.0 if label == "base.w" else 0.0
            codes.append(MISSING if value is None else round(value / f.scale))
    return codes


class Standing:
    """It, frame by frame."""

    def __init__(self, text: str | None = None, model: BalanceModel | None = None) -> None:
        self.schema = Schema.parse(text or make_schema_text())
        self.model = model or make_model()
        self._course = BalanceCourse(self.model, self.schema)
        self._readings = FrameReadings(self.schema)
        self._poses = LinkPoses(self.model.tree)

    def read(self, t_s: float = 0.0, **values: float | None) -> Balance:
        """The balance of one more frame."""
        codes = make_codes(self.schema, **values)
        self._readings.take(codes)
        self._poses.update(self._readings)
        return self._course.read(codes, self._readings, self._poses.compute_world_poses(), t_s)
