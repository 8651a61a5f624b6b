"""Makes `wire/vectors/schemas.json`: what every reader refuses and takes, and what mappings make of codes."""

from __future__ import annotations

import json
import math
from typing import Any

from posecast_wire import MISSING, Schema, SchemaError, build_schema_text, compute_joint_values

from wire.python.tools.vector_script import write_document, write_lists


def schemas() -> dict[str, Any]:
    """Texts no reader takes, each with the place it must name, texts every reader takes, and a mapping."""
    field = {"name": "a", "labels": "j"}
    doc = {"type": "schema", "v": 1, "robot": "r", "labels": {"j": ["x", "y"], "k": ["z"]}, "fields": [field]}
    two = {"name": "b", "labels": "j"}

    def fields(*of: object) -> object:
        return doc | {"fields": list(of)}

    def mapping(**of: object) -> object:
        return doc | {"mapping": of}

    def more(value: str) -> str:
        """A good schema but for a member nobody knows."""
        return json.dumps(doc | {"more": 0}).replace('"more": 0', f'"more": {value}')

    # one byte of UTF-8 more than 32 KiB
    said = {f"b{n}": {"en": {"say": "🦾" * 200, "why": "🦾" * 200}} for n in range(20)}
    too_long = {"a": said | {"last": {"en": {"say": "🦾" * 192, "why": "x"}}}}
    bad: list[tuple[str, object]] = [
        ("schema", "{"),
        ("schema", "[" * 3000),
        ("schema", "[]"),
        ("schema", '{"type":"schema","v":1,"robot":"r","labels":{"j":["x"]},"fields":[NaN]}'),
        ("schema", "\ufeff" + json.dumps(doc)),
        ("schema", more('"\\ud800"')),
        ("schema", more('{"\\udc00":0}')),
        ("schema", more('"\\ude00\\ud83d"')),
        ("schema", more("1e999")),
        ("schema", more("-1e999")),
        ("schema", more("7" * 5000)),
        ("schema", more("-" + "7" * 310)),
        ("schema", more("[" * 63 + "0" + "]" * 63)),
        ("schema", more('{"a":' * 1000 + "0" + "}" * 1000)),
        ("schema", more('"\0"')),
        ("type", "{}"),
        ("type", doc | {"type": "event"}),
        ("v", doc | {"v": 2}),
        ("v", doc | {"v": True}),
        ("v", doc | {"v": 1.5}),
        ("robot", doc | {"robot": ""}),
        ("robot", doc | {"robot": "a\nb"}),
        ("robot", doc | {"robot": "x" * 201}),
        ("labels", doc | {"labels": []}),
        ("labels.j", doc | {"labels": {"j": "x"}}),
        ("labels.j[1]", doc | {"labels": {"j": ["x", 1]}}),
        ("labels.j", doc | {"labels": {"j": ["x", "x"]}}),
        ("labels.j[0]", doc | {"labels": {"j": ["\0"]}}),
        ("labels.j[1]", doc | {"labels": {"j": ["x", "🦾" * 201]}}),
        ("labels.j", '{"labels":{"j":["x"],"j":["x","x"]},"type":"schema","v":1,"robot":"r","fields":[]}'),
        ("labels key", doc | {"labels": {"": ["x"]}}),
        ("labels key", doc | {"labels": {"k" * 201: ["x"]}}),
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
        ("fields[0].scale", json.dumps(fields(field | {"scale": 7})).replace("7", "1e-999")),
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
        ("mapping.joints.J.offset", mapping(joints={"J": {"terms": [], "offset": None}})),
        ("mapping.sensors.S.kind", mapping(sensors={"S": {"kind": "lidar"}})),
        ("mapping.sensors.S.link", mapping(sensors={"S": {"kind": "imu", "link": 1}})),
        ("mapping.sensors.S.xyz", mapping(sensors={"S": {"kind": "imu", "xyz": [0, 0]}})),
        ("mapping.sensors.S.xyz", mapping(sensors={"S": {"kind": "imu", "xyz": None}})),
        ("mapping.sensors.S.rpy", mapping(sensors={"S": {"kind": "imu", "rpy": [0] * 1000}})),
        ("mapping.sensors.S.name", mapping(sensors={"S": {"kind": "imu", "name": None}})),
        ("mapping.names.x", mapping(names={"x": 1})),
        ("mapping.translated_names.ko", mapping(translated_names={"ko": "x"})),
        ("mapping.translated_names.ko.x", mapping(translated_names={"ko": {"x": 1}})),
        ("mapping.translated_names key", mapping(translated_names={"": {}})),
        ("mapping.thresholds.a", mapping(thresholds={"a": 1})),
        ("mapping.thresholds.a.x", mapping(thresholds={"a": {"x": {"low": 1, "high": 1}}})),
        ("mapping.thresholds.a.x.caution", mapping(thresholds={"a": {"x": {"caution": 0}}})),
        ("mapping.thresholds.a.x.caution", mapping(thresholds={"a": {"x": {"caution": None}}})),
        ("mapping.thresholds.a key", mapping(thresholds={"a": {"": {}}})),
        ("mapping.tolerance.*", mapping(tolerance={"*": -1})),
        ("mapping.severity.a.jam", mapping(severity={"a": {"jam": "bad"}})),
        ("mapping.severity.a key", mapping(severity={"a": {"\n": "fault"}})),
        ("mapping.units.a.x", mapping(units={"a": {"x": 5}})),
        ("mapping.units.a key", mapping(units={"a": {"k" * 201: "mm"}})),
        (
            "mapping.explain.a.jam.en.say",
            mapping(explain={"a": {"jam": {"en": {"why": "It hit something."}}}}),
        ),
        ("mapping.explain.a.jam.en.say", mapping(explain={"a": {"jam": {"en": {"say": "x" * 201}}}})),
        ("mapping.explain.a.jam.en.why", mapping(explain={"a": {"jam": {"en": {"say": "x", "why": 1}}}})),
        ("mapping.explain.a.jam.en", mapping(explain={"a": {"jam": {"en": "stuck"}}})),
        (
            "mapping.explain.a.jam",
            mapping(explain={"a": {"jam": {f"x{n}": {"say": "x"} for n in range(17)}}}),
        ),
        ("mapping.explain", json.dumps(mapping(explain=too_long), ensure_ascii=False)),
    ]
    good: list[tuple[str, str]] = [
        ("of a member named twice the last counts", more('{"type":1},"type":7,"type":"schema"')),
        (
            "in every object",
            '{"fields":[{"name":"b","labels":"j","name":"a","scale":"?","scale":2}],"robot":"no","robot":"r",'
            '"labels":{"j":[7],"j":["x"]},"labels":{"j":["y","z"]},"v":1,"type":"schema","v":1}',
        ),
        ("no name is special", json.dumps(doc).replace('"j"', '"__proto__"').replace('"a"', '"constructor"')),
        (
            "numbers as JSON lets them be written",
            json.dumps(fields(field | {"scale": 7})).replace("7", "25E-1"),
        ),
        ("a long number", json.dumps(fields(field | {"scale": 7})).replace("7", "1." + "0" * 5000)),
        ("numbers a double rounds to 0, and whole ones it rounds", more("[1e-999,-0,-0.0,9007199254740993]")),
        ("the largest number", more("[" + "9" * 308 + ",1.7976931348623157e308]")),
        ("64 levels", more("[" * 62 + "0" + "]" * 62)),
        ("characters past 16 bits, and as two escapes", more('{"\\ud83e\\uddbe":"🦾"}')),
        ("a backslash before what looks like an escape", more('"\\\\ud800"')),
        ("a name of 200 characters", json.dumps(doc, ensure_ascii=False).replace('"x"', f'"{"🦾" * 200}"')),
        ("space around it", f" \t\r\n{json.dumps(doc)} \t\r\n"),
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
        name: {k: None if math.isnan(v) else v for k, v in compute_joint_values(schema, codes, name).items()}
        for name in ("ref", "pos", "aux", "none")
    }
    texts = [{"where": w, "text": t if isinstance(t, str) else json.dumps(t)} for w, t in bad]
    for one in texts:
        _must_refuse(**one)
    taken = [{"why": why, "text": t, "fields": _read(t)} for why, t in good]
    return {
        "bad": texts,
        "good": taken,
        "id": schema.id,
        "mapping": {"text": mapped, "codes": codes, "joints": values},
    }


def _must_refuse(where: str, text: str) -> None:
    try:
        Schema.parse(text)
    except SchemaError as e:
        if str(e).startswith(f"{where}: "):
            return
        raise AssertionError(f"{e} does not name {where}") from e
    raise AssertionError(f"{where}: nothing wrong was found")


def _read(text: str) -> list[dict[str, object]]:
    return [{"name": f.name, "labels": f.labels, "scale": f.scale} for f in Schema.parse(text).fields]


def files() -> dict[str, str]:
    """The file's name and text: one schema a line."""
    made = schemas()
    parts = write_lists({name: made.pop(name) for name in ("bad", "good")}, ensure_ascii=False)
    parts += [f"{json.dumps(k)}: {json.dumps(v, ensure_ascii=False)}" for k, v in made.items()]
    return {"schemas.json": write_document(parts)}
