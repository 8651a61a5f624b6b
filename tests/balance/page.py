"""The page's balance for a sequence of frames, computed by its own TypeScript in Node."""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from posecast_wire import Schema, build_schema_text
from posecast_wire.schema import MISSING

REPO = Path(__file__).resolve().parents[2]
FINE = 1e-7  # steps of the wire: far below what is measured here

Document = dict[str, Any]


def build_fine_schema(
    joints: Sequence[str], sensors: Mapping[str, Mapping[str, Any]], wrenches: Sequence[str] = ()
) -> str:
    """A schema of joints, a base, and wrenches of six components at these sites."""
    labels: dict[str, list[str]] = {
        "joint": list(joints),
        "base": [f"base.{part}" for part in "xyz"],
        "baseq": [f"base.{part}" for part in "wxyz"],
    }
    if wrenches:
        labels["ftf"] = [f"{site}.f{axis}" for site in wrenches for axis in "xyz"]
        labels["ftm"] = [f"{site}.m{axis}" for site in wrenches for axis in "xyz"]
    scales = {"joint": FINE, "base": FINE, "baseq": FINE, "ftf": 1e-4, "ftm": 1e-5}
    fields = [
        {"name": "pos" if name == "joint" else name, "labels": name, "scale": scales[name]} for name in labels
    ]
    return build_schema_text("r", labels, fields, {"sensors": dict(sensors)})


def encode_values(schema_text: str, values: Mapping[str, float]) -> list[int]:
    """Codes of values by "FIELD LABEL"."""
    schema = Schema.parse(schema_text)
    codes = []
    for field in schema.fields:
        for label in field.labels:
            value = values.get(f"{field.name} {label}", math.nan)
            codes.append(round(value / field.scale) if math.isfinite(value) else MISSING)
    return codes


def read_balance(manifest: Document, schema: str, frames: Sequence[Document]) -> list[Document]:
    """The page's result for frames with `t`, `codes`, optionally `velocity` (`rigs/balance_courses.ts`)."""
    found: list[Document] = _run("readBalance", manifest, schema, frames)["frames"]
    return found


def read_stances(manifest: Document, schema: str, frames: Sequence[Document]) -> Document:
    """The page's text for frames with `t` and `codes` (`readStances` there)."""
    return _run("readStances", manifest, schema, frames)


def _run(function: str, manifest: Document, schema: str, frames: Sequence[Document]) -> Document:
    course = json.dumps({"manifest": manifest, "schema": schema, "frames": frames})
    command = ["node", str(REPO / "spa/tests/rigs/run.mjs"), "balance_courses.ts", function]
    done = subprocess.run(command, input=course, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found: Document = json.loads(done.stdout)
    return found
