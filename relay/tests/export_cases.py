"""Makes `wire/vectors/exports.json`: segments, and the CSV and the messages that are made of them. The page's
tests find the same. Its CSV also has columns of balance, of a robot whose balance is known by heart. NaN is
null; a rotation is the quaternion with w ≥ 0.

    python -m relay.tests.export_cases
"""

from __future__ import annotations

import json
import math
import random
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from posecast_wire import Schema, build_schema_text
from rosbags.typesys import Stores, get_typestore

from .export_stage import FROM_MS, Named, Take, csv_of, hash_of, in_order, mcap_of, messages_of
from .link_pose_cases import make_manifest

VECTORS = Path(__file__).resolve().parents[2] / "wire" / "vectors" / "exports.json"
STORE = get_typestore(Stores.ROS2_JAZZY)

JOINTS = ["lift", "m1", "m2", "m3", "m4", "knee", "wrist", "finger"]
BITS = ["homed", "enabled", "a|b", "=1+1", 'so "quoted";=2+2', "back\\slash", "a, b"]
MAPPING: dict[str, Any] = {
    "joints": {
        "hip": {"terms": [["m1", 0.5], ["m2", -0.25]], "offset": 0.2},
        "toe": {"terms": [["m3", -2.0]], "offset": 0.1},
        "knee": {"terms": [["knee", 1.0]], "offset": -0.26},
        "hook": {"terms": [["wrist", 0.035]]},
        "claw": {"terms": [["finger", 0.001], ["m1", 0.1]]},
        "left grip": {"terms": [["m4", 1.0]]},
        "right grip": {"terms": [["m4", -1.0]]},
    },
    "sensors": {
        "RF": {"kind": "wrench", "name": "right foot", "link": "foot"},
        "torso": {"kind": "imu", "name": "torso", "link": "chest", "rpy": [0.1, 0, 0]},
        "pelvis": {"kind": "imu", "name": "pelvis", "link": None},
    },
    "units": {
        "pos": {"wrist": "deg", "finger": "ticks"},
        "vel": {"lift": "m/s", "wrist": "rpm"},
        "effort": {"lift": "N", "finger": "%"},
    },
}
SITES = {
    "ftf": ["RF.fx", "RF.fy", "RF.fz", "palm.1.fz"],
    "ftm": ["RF.mx", "RF.my", "RF.mz"],
    "quat": [f"{site}.{part}" for site in ("torso", "pelvis") for part in "wxyz"],
    "tilt": ["cart.roll", "cart.pitch"],
    "gyro": [f"{site}.{part}" for site in ("torso", "cart") for part in "xyz"],
    "acc": ["torso.x", "torso.y", "torso.z"],
    "volt": ["main", "=aux", "a,b", 'x";＝y'],
}


def make_schema(extra: Sequence[Mapping[str, Any]] = ()) -> str:
    """A robot that reports everything."""
    fields: list[Mapping[str, Any]] = [
        {"name": "ref", "labels": "joint", "unit": "rad", "scale": 0.001},
        {"name": "pos", "labels": "joint", "unit": "rad", "scale": 0.0005, "rel": "ref"},
        {"name": "vel", "labels": "joint", "unit": "rad/s", "scale": 0.01},
        {"name": "effort", "labels": "joint", "unit": "Nm", "scale": 0.05},
        {"name": "cur", "labels": "joint", "unit": "mA", "scale": 10},
        {"name": "flags", "labels": "joint", "bits": BITS},
        {"name": "ftf", "labels": "ftf", "unit": "kN", "scale": 0.001},
        {"name": "ftm", "labels": "ftm", "unit": "N·m", "scale": 0.05},
        {"name": "quat", "labels": "quat", "scale": 0.001},
        {"name": "tilt", "labels": "tilt", "unit": "deg", "scale": 0.1},
        {"name": "gyro", "labels": "gyro", "unit": "deg/s", "scale": 1 / 3},
        {"name": "acc", "labels": "acc", "unit": "g", "scale": 0.002},
        {"name": "volt", "labels": "volt", "unit": "V", "scale": 2.5},
        *extra,
    ]
    return build_schema_text("made-up", {"joint": JOINTS, **SITES}, fields, MAPPING)


def make_rows(schema: Schema, count: int, seed: str, loses: bool = True) -> list[list[float | None]]:
    """Readings in the schema's order and units; in the first row none is missing, in the second all are."""
    dice = random.Random(seed)
    rows: list[list[float | None]] = []
    for i in range(count):
        row: list[float | None] = []
        for f in schema.fields:
            for _ in f.labels:
                code = dice.randrange(1 << len(f.bits) + 1) if f.bits else dice.randint(-900, 900)
                gone = loses and (i == 1 or (i > 1 and dice.random() < 0.1))
                row.append(None if gone else code * f.scale)
        rows.append(row)
    return rows


def make_cases() -> list[dict[str, Any]]:
    """All cases."""
    text = make_schema()
    manifest = json.dumps(make_manifest(), separators=(",", ":"))
    model = hash_of(manifest)
    one = Take(text, model=model, segment_frames=4)
    frames = one.encode(make_rows(one.schema, 10, "everything"))
    event = {"type": "event", "n": 41, "t": 1.5, "at": 1795357260, "source": "m3", "text": "it's stuck"}
    events = {
        2: {**event, "level": "fault", "state": "on"},
        4: {**event, "n": 42, "level": "fault", "state": "off"},
        5: {**event, "n": 43, "level": "caution", "state": "on", "source": "", "text": "배터리"},
        7: {**event, "n": 44, "level": "info", "state": "on"},
    }
    alone = one.record(frames, events=events)
    # a second recorder, which lost other frames, and wrote later
    other = Take(text, take=8, model=model, segment_frames=3)
    heard, other_heard = (lambda i: i not in (3, 6, 9)), (lambda i: i != 2)
    twice = in_order(one.record(frames, heard=heard), other.record(frames, 4000, other_heard))
    later = Take(
        make_schema([{"name": "charge", "labels": "volt", "unit": "%", "scale": 0.5}]),
        take=11,
        run_id=12,
        from_ms=FROM_MS + 5000,
        segment_frames=4,
    )
    two = [*alone, *later.record(later.encode(make_rows(later.schema, 3, "later"), 7))]
    texts, models = [text], {model: manifest}
    return [
        make_standing(),
        make_case("a robot that reports everything", alone, texts, models),
        make_case("two recorders that lost different frames", twice, texts, models),
        make_case("another schema, then no model", two, [text, later.schema_text], models),
        make_case("a part of it", alone, texts, {}, FROM_MS + 60, FROM_MS + 170),
    ]


BALANCE_COLUMNS = (
    *(f"balance.centre_of_mass.{axis} [m]" for axis in "xyz"),
    *(f"balance.{point}.{axis} [m]" for point in ("capture_point", "centre_of_pressure") for axis in "xy"),
    *("balance.floor [m]", "balance.margin [mm]"),
)
SOLE = [[0.12, -0.05, 0.0], [0.12, 0.05, 0.0], [-0.08, 0.05, 0.0], [-0.08, -0.05, 0.0]]
HALF_N = 196.2  # half its weight


class StandingFoot(NamedTuple):
    """`left_m`: to the left of the trunk's middle; `sensor_up_m`: of its wrench sensor above its sole."""

    leg: str
    left_m: float
    sensor_up_m: float


FEET = {"RF": StandingFoot("right_leg", -0.1, 0.2), "LF": StandingFoot("left_leg", 0.1, 0.1)}


def make_standing_manifest() -> dict[str, Any]:
    """A trunk of 40 kg on two legs that slide up and down, 0.9 m above its soles. The right sole is fixed
    0.1 m below the right foot, the left foot has its own."""
    legs = [
        {"name": "right_leg", "type": "prismatic", "parent": 0, "child": 1, "xyz": [0, -0.1, -0.8]},
        {"name": "ankle", "type": "fixed", "parent": 1, "child": 2, "xyz": [0, 0, -0.1]},
        {"name": "left_leg", "type": "prismatic", "parent": 0, "child": 3, "xyz": [0, 0.1, -0.9]},
    ]
    return {
        "v": 2,
        "robot": "standing",
        "files": [],
        "levels": [],
        "findings": [],
        "links": ["trunk", "right_foot", "right_sole", "left_foot"],
        "joints": [{**leg, "axis": [0, 0, 1]} for leg in legs],
        "visuals": [],
        "inertials": [{"link": 0, "mass_kg": 40, "xyz": [0.02, 0, 0.1], "inertia": [0.1, 0, 0, 0.1, 0, 0.1]}],
        "soles": [{"link": 2, "points": SOLE}, {"link": 3, "points": SOLE}],
    }


def make_standing_schema() -> str:
    """It reports its legs and the wrench of each foot, with steps of a thousandth."""
    parts = {"ftf": ("fx", "fy", "fz"), "ftm": ("mx", "my", "mz")}
    labels = {name: [f"{site}.{part}" for site in FEET for part in of] for name, of in parts.items()}
    fields = [
        {"name": "pos", "labels": "joint", "unit": "", "scale": 0.001},
        {"name": "ftf", "labels": "ftf", "unit": "N", "scale": 0.001},
        {"name": "ftm", "labels": "ftm", "unit": "N·m", "scale": 0.001},
    ]
    sensors = {
        site: {"kind": "wrench", "name": site, "link": link, "xyz": [0, 0, 0.1]}
        for site, link in (("RF", "right_foot"), ("LF", "left_foot"))
    }
    joints = [foot.leg for foot in FEET.values()]
    return build_schema_text("standing", {"joint": joints, **labels}, fields, {"sensors": sensors})


def make_standing() -> dict[str, Any]:
    """The case of a robot that leans, lifts a foot, loses a reading, and at last is in the air."""
    text = make_standing_schema()
    manifest = json.dumps(make_standing_manifest(), separators=(",", ":"))
    take = Take(text, model=hash_of(manifest), segment_frames=4)
    channels = [label for f in take.schema.fields for label in f.labels]
    dice = random.Random("standing")
    rows: list[list[float | None]] = []
    cells: list[Sequence[str]] = [BALANCE_COLUMNS]
    for i in range(9):
        read: dict[str, float | None] = {
            f"{site}.{part}": dice.uniform(-9, 9) for site in FEET for part in ("fx", "fy", "mx", "my", "mz")
        }
        read |= {"right_leg": 0.01 * dice.random(), "left_leg": 0.01 * dice.random()}
        read |= {"RF.fz": 0.0 if i == 8 else HALF_N, "LF.fz": 3.0 if i in (3, 4, 8) else HALF_N}
        if i in (6, 7):
            read["RF.my" if i == 6 else "RF.fz"] = None
        rounded = {name: None if v is None else round(v, 3) for name, v in read.items()}
        rows.append([rounded[label] for label in channels])
        cells.append(write_balance(rounded, is_first=i == 0))
    case = make_case(
        "a robot whose balance is known",
        take.record(take.encode(rows)),
        [text],
        {hash_of(manifest): manifest},
    )
    lines = zip(case["csv"].splitlines(), cells, strict=True)
    return {**case, "csv": "".join(",".join((line, *more)) + "\r\n" for line, more in lines)}


def write_balance(read: Mapping[str, float | None], is_first: bool) -> list[str]:
    """The cells of the standing robot's balance. It stands on its lower foot, which is at a height of 0. Its
    mass is 2 cm before the trunk, and does not move to any side: the capture point is below it."""
    legs = {site: read[foot.leg] or 0.0 for site, foot in FEET.items()}
    lowest = min(legs.values())
    centre = ["0.0200", "0.0000", f"{1 - lowest:.4f}"]
    forces = {site: read[f"{site}.fz"] for site in FEET}
    bearing = [site for site, force_n in forces.items() if force_n == HALF_N]
    if None in forces.values() or not bearing:
        return [*centre, *[""] * 6]
    captured = ["", ""] if is_first else centre[:2]
    # on both feet, the nearest edges are 10 cm before and behind the mass; on one, its sole begins 5 cm aside
    margin = "100.0" if len(bearing) == 2 else "-50.0"
    floor = min(legs[site] - lowest for site in bearing)
    return [*centre, *captured, *_write_pressure(read, bearing), f"{floor:.4f}", margin]


def _write_pressure(read: Mapping[str, float | None], bearing: Sequence[str]) -> list[str]:
    """The mean of where the floor pushes the feet, each with half the weight. A foot with 3 N has it far
    outside its sole, and counts for nothing."""
    places: list[tuple[float, float]] = []
    for site in bearing:
        fx, fy, fz, mx, my = (read[f"{site}.{part}"] for part in ("fx", "fy", "fz", "mx", "my"))
        if fx is None or fy is None or not fz or mx is None or my is None:
            return ["", ""]
        foot = FEET[site]
        ahead_m, left_m = -(my + foot.sensor_up_m * fx) / fz, (mx - foot.sensor_up_m * fy) / fz
        places.append((ahead_m, foot.left_m + left_m))
    return [f"{sum(axis) / len(places):.4f}" for axis in zip(*places, strict=True)]


def make_case(
    name: str,
    segments: Sequence[Named],
    texts: Sequence[str],
    models: Mapping[str, str],
    from_ms: int = FROM_MS,
    to_ms: int = FROM_MS + 60_000,
) -> dict[str, Any]:
    """A case. `messages`: topic, type, moment (unix µs), content, in the order of frames, of which each has
    /joint_states last."""
    span = {"from_ms": from_ms, "to_ms": to_ms}
    manifests = {sha256: text.encode() for sha256, text in models.items()}
    csv, _ = csv_of(segments, *texts, **span)
    data, _ = mcap_of(segments, *texts, models=manifests, **span)
    messages = [
        [topic, type_name, unix_ns // 1000, to_json(STORE.deserialize_cdr(raw, type_name))]
        for topic, type_name, unix_ns, raw in messages_of(data)
    ]
    return {
        "name": name,
        "from_ms": from_ms,
        "to_ms": to_ms,
        "schemas": [*texts],
        "models": [*models.values()],
        "segments": [raw.hex() for _, raw in segments],
        "csv": csv,
        "messages": messages,
    }


def to_json(value: Any) -> Any:
    """What a decoded message holds, with members by their ROS names."""
    if isinstance(value, np.ndarray | list | tuple):
        return [to_json(each) for each in value]
    if isinstance(value, float | np.floating):
        return None if math.isnan(value) else round(float(value), 6) + 0.0
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, str):
        return value
    members = {name: to_json(getattr(value, name)) for name in value.__dataclass_fields__ if name[:2] != "__"}
    if set(members) == {"x", "y", "z", "w"} and (members["w"] or 0) < 0:
        members = {name: None if part is None else -part for name, part in members.items()}
    return members


def write_cases(cases: Sequence[Mapping[str, Any]]) -> str:
    """A line a message, so that a change can be read."""
    parts: list[str] = []
    for case in cases:
        head = json.dumps({k: v for k, v in case.items() if k != "messages"}, ensure_ascii=False, indent=1)
        said = (json.dumps(each, separators=(",", ":"), ensure_ascii=False) for each in case["messages"])
        parts.append(head[:-2] + ',\n "messages": [\n' + ",\n".join(said) + "\n]}")
    return '{"cases": [\n' + ",\n".join(parts) + "\n]}\n"


if __name__ == "__main__":
    VECTORS.write_text(write_cases(make_cases()))
