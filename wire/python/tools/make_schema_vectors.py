"""Makes `wire/vectors/schemas.json`: what every reader refuses, and what a mapping makes of codes."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from posecast_wire import MISSING, Schema, SchemaError, build_schema_text, joint_values

FOLDER = Path(__file__).resolve().parents[2] / "vectors"


def schemas() -> dict[str, Any]:
    """Texts no reader takes, each with the place it must name; and what a mapping makes of codes."""
    field = {"name": "a", "labels": "j"}
    doc = {"type": "schema", "v": 1, "robot": "r", "labels": {"j": ["x", "y"], "k": ["z"]}, "fields": [field]}
    two = {"name": "b", "labels": "j"}

    def fields(*of: object) -> object:
        return doc | {"fields": list(of)}

    def mapping(**of: object) -> object:
        return doc | {"mapping": of}

    bad: list[tuple[str, object]] = [
        ("schema", "{"),
        ("schema", "[" * 3000),
        ("schema", "[]"),
        ("schema", '{"type":"schema","v":1,"robot":"r","labels":{"j":["x"]},"fields":[NaN]}'),
        ("type", "{}"),
        ("type", doc | {"type": "event"}),
        ("v", doc | {"v": 2}),
        ("v", doc | {"v": True}),
        ("robot", doc | {"robot": ""}),
        ("robot", doc | {"robot": "a\nb"}),
        ("robot", doc | {"robot": "x" * 201}),
        ("labels", doc | {"labels": []}),
        ("labels.j", doc | {"labels": {"j": "x"}}),
        ("labels.j[1]", doc | {"labels": {"j": ["x", 1]}}),
        ("labels.j", doc | {"labels": {"j": ["x", "x"]}}),
        ("labels.__proto__[0]", '{"type":"schema","v":1,"labels":{"__proto__":[0]},"fields":[]}'),
        ("fields", doc | {"fields": []}),
        ("fields", doc | {"fields": {}}),
        ("fields[0]", fields(7)),
        ("fields[0].name", fields({"labels": "j"})),
        ("fields[0].name", fields(field | {"name": "a b"})),
        ("fields[0].name", fields(field | {"name": "a" * 64})),
        ("fields[1].name", fields(field, field)),
        ("fields[0].labels", fields(field | {"labels": "none"})),
        ("fields[0].labels", fields(field | {"labels": "constructor"})),
        ("fields[0].labels", fields(field | {"labels": ["j"]})),
        ("fields[0].scale", fields(field | {"scale": 0})),
        ("fields[0].scale", fields(field | {"scale": -1})),
        ("fields[0].scale", fields(field | {"scale": "1"})),
        ("fields[0].scale", fields(field | {"scale": True})),
        ("fields[0].scale", fields(field | {"scale": 1e13})),
        ("fields[0].scale", json.dumps(fields(field | {"scale": 7})).replace("7", "1e999")),
        ("fields[0].unit", fields(field | {"unit": 1})),
        ("fields[0].bits", fields(field | {"bits": [f"b{i}" for i in range(29)]})),
        ("fields[0].bits", fields(field | {"bits": ["jam", "jam"]})),
        ("fields[0].scale", fields(field | {"bits": ["jam"], "scale": 2})),
        ("fields[0].rel", fields(field | {"rel": "a"})),
        ("fields[1].rel", fields(field, two | {"rel": 1})),
        ("fields[1].rel", fields(field, {"name": "b", "labels": "k", "rel": "a"})),
        ("fields[0].slow", fields(field | {"slow": 1})),
        ("mapping", doc | {"mapping": []}),
        ("mapping.joints", mapping(joints=[])),
        ("mapping.joints.J.terms", mapping(joints={"J": {}})),
        ("mapping.joints.J.terms[0]", mapping(joints={"J": {"terms": [["x"]]}})),
        ("mapping.joints.J.terms[0][1]", mapping(joints={"J": {"terms": [["x", "1"]]}})),
        ("mapping.joints.J.offset", mapping(joints={"J": {"terms": [], "offset": "0"}})),
        ("mapping.sensors.S.kind", mapping(sensors={"S": {"kind": "lidar"}})),
        ("mapping.sensors.S.link", mapping(sensors={"S": {"kind": "imu", "link": 1}})),
        ("mapping.sensors.S.xyz", mapping(sensors={"S": {"kind": "imu", "xyz": [0, 0]}})),
        ("mapping.names.x", mapping(names={"x": 1})),
        ("mapping.thresholds.a", mapping(thresholds={"a": 1})),
        ("mapping.thresholds.a.x", mapping(thresholds={"a": {"x": {"low": 1, "high": 1}}})),
        ("mapping.thresholds.a.x.caution", mapping(thresholds={"a": {"x": {"caution": 0}}})),
        ("mapping.tolerance.*", mapping(tolerance={"*": -1})),
        ("mapping.severity.a.jam", mapping(severity={"a": {"jam": "bad"}})),
        ("mapping.units.a.x", mapping(units={"a": {"x": 5}})),
    ]
    mapped = build_schema_text(
        "mapped",
        {"joint": ["LSR", "NK1", "NK2", "RKN"], "other": ["LSR", "x"]},
        [
            {"name": "ref", "labels": "joint", "scale": 0.001},
            {"name": "pos", "labels": "joint", "scale": 0.001, "rel": "ref"},
            {"name": "aux", "labels": "other", "scale": 2},
        ],
        {
            "joints": {
                "LSR": {"terms": [["LSR", 1.0]], "offset": 0.261799},
                "HNP": {"terms": [["NK1", 0.02705], ["NK2", 0.02705]], "offset": -5.138},
                "gone": {"terms": [["nowhere", 1]]},
                "fixed": {"terms": [], "offset": 0.5},
                "__proto__": {"terms": [["RKN", -1]]},
            }
        },
    )
    schema = Schema.parse(mapped)
    codes = [1000, 2000, 3000, -500, 1010, MISSING, 3000, -499, 7, 8]
    values = {
        name: {k: None if math.isnan(v) else v for k, v in joint_values(schema, codes, name).items()}
        for name in ("ref", "pos", "aux", "none")
    }
    texts = [{"where": w, "text": t if isinstance(t, str) else json.dumps(t)} for w, t in bad]
    for one in texts:
        _must_refuse(**one)
    return {"bad": texts, "id": schema.id, "mapping": {"text": mapped, "codes": codes, "joints": values}}


def _must_refuse(where: str, text: str) -> None:
    try:
        Schema.parse(text)
    except SchemaError as e:
        if str(e).startswith(f"{where}: "):
            return
        raise AssertionError(f"{e} does not name {where}") from e
    raise AssertionError(f"{where}: nothing wrong was found")


def files() -> dict[str, str]:
    """The file's name and text: one schema a line."""
    made = schemas()
    bad = ",\n".join(json.dumps(one, ensure_ascii=False) for one in made.pop("bad"))
    rest = ",\n".join(f"{json.dumps(k)}: {json.dumps(v, ensure_ascii=False)}" for k, v in made.items())
    return {"schemas.json": f'{{\n"bad": [\n{bad}\n],\n{rest}\n}}\n'}


if __name__ == "__main__":
    for name, content in files().items():
        (FOLDER / name).write_text(content, encoding="utf-8")
        print(f"{name}: {len(content.encode())} bytes")
