"""Makes `wire/vectors/link_poses.json`: models, what robots report, and where their links are then. The
page's tests (spa/tests/model/kinematics.test.ts) find the same.

    python -m relay.tests.link_pose_cases
"""

from __future__ import annotations

import copy
import json
import math
import random
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from posecast_relay.export.link_poses import FrameReadings, LinkPose, LinkPoses, compose_poses
from posecast_relay.export.model_tree import ModelTree, read_model_tree
from posecast_wire import Schema, build_schema_text
from posecast_wire.schema import MISSING

ROOT = Path(__file__).resolve().parents[2]
VECTORS = ROOT / "wire" / "vectors" / "link_poses.json"
HALF = math.sqrt(0.5)

JOINTS: list[dict[str, Any]] = [
    {"name": "lift", "type": "prismatic", "parent": 0, "xyz": [0, 0, 0.4], "axis": [0, 0.6, 0.8]},
    {"name": "hip", "type": "revolute", "parent": 1, "xyz": [0.1, 0, 0], "quat": [HALF, HALF, 0, 0]},
    {"name": "knee", "type": "continuous", "parent": 2, "xyz": [0, 0, -0.3], "axis": [0, 1, 0]},
    {
        "name": "toe",
        "type": "revolute",
        "parent": 3,
        "xyz": [0, 0.1, -0.3],
        "axis": [0, 0, 1],
        "mimic": {"joint": 2, "multiplier": -0.5, "offset": 0.1},
    },
    {"name": "skull", "type": "fixed", "parent": 1, "xyz": [0, 0, 0.2], "quat": [0.5, 0.5, 0.5, 0.5]},
    {"name": "ball", "type": "floating", "parent": 5, "xyz": [0.05, 0, 0]},
    {
        "name": "cart",
        "type": "planar",
        "parent": 0,
        "xyz": [0, -0.5, 0],
        "axis": [0, 0, 1],
        "plane": [[1, 0, 0], [0, 1, 0]],
    },
    {
        "name": "drawer",
        "type": "prismatic",
        "parent": 7,
        "xyz": [0, 0, 0.1],
        "axis": [1, 0, 0],
        "mimic": {"joint": 0, "multiplier": 2, "offset": 0},
    },
]
LINKS = ["trunk", "chest", "thigh", "shin", "foot", "head", "eye", "trolley", "tray"]
CHANNELS = [
    *("lift", "m1", "m2", "knee", "toe"),
    *(
        "ball/trans_x",
        "ball/rot_x",
        "ball/rot_y",
        "ball/rot_z",
        "ball/rot_w",
        "cart/x",
        "cart/y",
        "cart/theta",
    ),
]
MAPPING = {
    "joints": {"hip": {"terms": [["m1", 0.5], ["m2", -0.25]], "offset": 0.2}},
    "sensors": {
        "battery": {"kind": "power", "name": "battery", "link": None},
        "imu": {"kind": "imu", "name": "imu", "link": "chest", "xyz": [0, 0, 0.1], "rpy": [0.1, -0.2, 0.3]},
    },
}


def make_manifest(boxes: bool = True) -> dict[str, Any]:
    """The made-up robot's."""
    visuals = [
        {"link": link, "source": "", "box": [[-0.1, -0.05, -0.3], [0.1, 0.06, 0.02]]} for link in (0, 4, 4, 7)
    ]
    visuals[2]["box"] = [[-0.02, -0.2, -0.35], [0.2, 0.01, 0.0]]
    joints = [{**joint, "child": i + 1} for i, joint in enumerate(JOINTS)]
    manifest: dict[str, Any] = {"v": 2, "robot": "made-up", "files": [], "levels": []}
    manifest |= {"links": LINKS, "joints": joints, "visuals": visuals if boxes else []}
    return copy.deepcopy(manifest)


def make_schema(
    fields: Mapping[str, Sequence[str]],
    mapping: Mapping[str, Any] = MAPPING,
    channels: Sequence[str] = CHANNELS,
) -> str:
    """Fields `pos` (of these channels) and others by their labels."""
    labels = {"joint": channels, **fields}
    specs = [
        {"name": "pos", "labels": "joint", "scale": 0.001},
        *({"name": f, "labels": f, "scale": 0.001} for f in fields),
    ]
    return build_schema_text("made-up", labels, specs, mapping)


def make_cases() -> list[dict[str, Any]]:
    """All cases."""
    quat = [f"imu.{part}" for part in "wxyz"]
    base = {"base": [f"base.{part}" for part in "xyz"], "baseq": [f"base.{part}" for part in "wxyz"]}
    tilt = {"tilt": ["imu.roll", "imu.pitch"]}
    no_sensors = {"joints": MAPPING["joints"]}
    gone = {**MAPPING, "sensors": {"imu": {"kind": "imu", "name": "imu", "link": "tail"}}}
    demo = (ROOT / "wire" / "vectors" / "segments" / "schema.json").read_text()
    demo_manifest = shorten(json.loads((ROOT / DEMO / "model" / "manifest.json").read_bytes()))
    document = json.loads(demo)
    document["fields"] = [f for f in document["fields"] if f["name"] not in ("base", "baseq")]
    afoot = json.dumps(document, separators=(",", ":"), ensure_ascii=False)
    thigh = {**MAPPING, "sensors": {"imu": {"kind": "imu", "name": "imu", "link": "thigh"}}}
    copied = make_schema({}, channels=[name for name in CHANNELS if name != "toe"])
    whole, bare = make_manifest(), make_manifest(boxes=False)
    return [
        make_case("stands upright", whole, make_schema({}), 4),
        make_case("stands as its IMU says", whole, make_schema({"quat": quat}), 6),
        make_case("stands on its links' origins", bare, make_schema({"quat": quat}), 3),
        make_case("knows roll and pitch only", whole, make_schema(tilt), 4),
        make_case("its only IMU is on the root", whole, make_schema({"quat": quat}, no_sensors), 3),
        make_case("its IMU is on a link that the model lacks", whole, make_schema({"quat": quat}, gone), 3),
        make_case("its IMU turns with a joint", whole, make_schema({"quat": quat}, thigh), 12),
        make_case("a joint copies another", whole, copied, 4),
        make_case("knows where its base is", whole, make_schema({"quat": quat, **base}), 8),
        make_case("the demo robot", demo_manifest, demo, 4),
        make_case("the demo robot without a base", demo_manifest, afoot, 4),
    ]


DEMO = Path("edge-agent") / "src" / "posecast_edge" / "demo_bundle"


def shorten(manifest: dict[str, Any]) -> dict[str, Any]:
    """What poses need of a manifest."""
    visuals = [{"link": v["link"], "source": "", "box": v["box"]} for v in manifest["visuals"]]
    kept = {name: manifest[name] for name in ("v", "robot", "links", "joints")}
    return {**kept, "files": [], "levels": [], "visuals": visuals}


def make_case(name: str, manifest: dict[str, Any], schema_text: str, count: int) -> dict[str, Any]:
    """A case of so many frames. Some readings are missing, in the first one none and in the second all."""
    dice = random.Random(name)
    schema = Schema.parse(schema_text)
    tree = read_model_tree(json.dumps(manifest).encode())
    poses = LinkPoses(tree)
    readings = FrameReadings(schema)
    frames: list[dict[str, Any]] = []
    for i in range(count):
        codes: list[int] = []
        for f in schema.fields:
            most = 1 if f.bits else round(0.8 / f.scale)
            codes += [dice.randint(-most, most) if not f.bits else 1 for _ in f.labels]
        lost = [i == 1 or (i > 1 and dice.random() < 0.1) for _ in codes]
        codes = [MISSING if gone else code for code, gone in zip(codes, lost, strict=True)]
        readings.take(codes)
        poses.update(readings)
        world = place_links(tree, poses)
        frames.append(
            {"codes": codes, "links": [[round(n, 7) + 0.0 for n in (*p.xyz, *p.quat)] for p in world]}
        )
    return {"name": name, "manifest": manifest, "schema": schema_text, "frames": frames}


def place_links(tree: ModelTree, poses: LinkPoses) -> list[LinkPose]:
    """world_from_link of each link."""
    world = [poses.poses[0]]
    for joint, parent_from_link in zip(tree.joints, poses.poses[1:], strict=True):
        world.append(compose_poses(world[joint.parent], parent_from_link))
    return world


def write_cases(cases: list[dict[str, Any]]) -> str:
    """A line a frame, so that a change can be read."""
    parts: list[str] = []
    for case in cases:
        head = json.dumps({k: v for k, v in case.items() if k != "frames"}, ensure_ascii=False)[:-1]
        lines = ",\n".join(json.dumps(frame, separators=(",", ":")) for frame in case["frames"])
        parts.append(f'{head}, "frames": [\n{lines}\n]}}')
    return '{"cases": [\n' + ",\n".join(parts) + "\n]}\n"


if __name__ == "__main__":
    VECTORS.write_text(write_cases(make_cases()))
