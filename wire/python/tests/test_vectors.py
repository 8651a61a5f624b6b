"""The committed vectors are what the script makes, and the decoder says of each what they say."""

from __future__ import annotations

import json
from typing import Any

import pytest
from posecast_wire import (
    BadFrame,
    BaseUnknown,
    Decoder,
    Encoder,
    Schema,
    SchemaError,
    compute_joint_values,
)
from posecast_wire.checked import escape_unseen

from wire.python.tools.__main__ import FOLDER, make_files

EXPORTED = ("exports.json", "link_poses.json")  # what the relay and the page make of it, see relay/tests
BY_HAND = ("visible.json",)
FRAMES = ("valid.json", "invalid.json", "lossy.json", "alternating.json")


def load(name: str) -> Any:
    return json.loads((FOLDER / name).read_text(encoding="utf-8"))


def cases() -> list[Any]:
    return [
        pytest.param(doc["schemas"], case, id=f"{name}: {case['name']}")
        for name in FRAMES
        for doc in [load(name)]
        for case in doc["cases"]
    ]


def test_committed_vectors_are_what_the_script_makes() -> None:
    files = make_files()
    assert sorted(p.name for p in FOLDER.iterdir() if p.is_file()) == sorted({*files, *EXPORTED, *BY_HAND})
    for name, text in files.items():
        assert (FOLDER / name).read_text(encoding="utf-8") == text, f"run python -m wire.python.tools: {name}"


@pytest.mark.parametrize("case", load("visible.json")["cases"], ids=lambda case: ascii(case["text"]))
def test_what_is_shown_of_a_text(case: dict[str, str]) -> None:
    assert escape_unseen(case["text"]) == case["shown"]


def test_vectors_are_small() -> None:
    assert sum(p.stat().st_size for p in FOLDER.rglob("*")) < 1_180_000


@pytest.mark.parametrize(("schemas", "case"), cases())
def test_decoder_follows(schemas: dict[str, str], case: dict[str, Any]) -> None:
    decoder = Decoder()
    for i, step in enumerate(case["steps"]):
        if "schema" in step:
            decoder.add_schema(schemas[step["schema"]])
            continue
        data = bytes.fromhex(step["frame"])
        result: dict[str, object]
        try:
            got = decoder.decode(data)
        except BaseUnknown:
            result = {"is": "unknown"}
        except BadFrame as e:
            result = {"is": "bad", "says": str(e)} if "says" in step else {"is": "bad"}
        else:
            result = {"is": "state", "seq": got.seq, "t": got.t_s, "codes": list(got.codes)}
        assert result == {k: step[k] for k in result}, f"step {i} {step.get('note', '')}"


@pytest.mark.parametrize(("schemas", "case"), [c for c in cases() if "encode" in c.values[1]])
def test_encoder_makes_the_same_bytes(schemas: dict[str, str], case: dict[str, Any]) -> None:
    how = case["encode"]
    encoder = Encoder(Schema.parse(schemas[how["schema"]]), how["key_interval_s"])
    for step in case["steps"]:
        if "from" in step:
            of = step["from"]
            frame = encoder.encode(of["codes"], of["seq"], of["t"], of["now"], of.get("force_key", False))
            assert frame.hex() == step["frame"]


@pytest.mark.parametrize("bad", load("schemas.json")["bad"], ids=lambda b: str(b["where"]))
def test_bad_schemas_are_refused_by_place(bad: dict[str, str]) -> None:
    with pytest.raises(SchemaError) as caught:
        Schema.parse(bad["text"])
    assert str(caught.value).startswith(f"{bad['where']}: ")
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("good", load("schemas.json")["good"], ids=lambda g: str(g["why"]))
def test_good_schemas_are_read_alike(good: dict[str, Any]) -> None:
    found = Schema.parse(good["text"]).fields
    assert [{"name": f.name, "labels": list(f.labels), "scale": f.scale} for f in found] == good["fields"]


def test_schema_id() -> None:
    doc = load("schemas.json")
    assert Schema.parse(doc["mapping"]["text"]).id == doc["id"]


def test_mapping_vector() -> None:
    doc = load("schemas.json")["mapping"]
    schema = Schema.parse(doc["text"])
    for field, joints in doc["joints"].items():
        got = compute_joint_values(schema, doc["codes"], field)
        assert {k: None if v != v else v for k, v in got.items()} == joints
