"""Schema text made and read. What is refused, and where, stands in the vectors."""

from __future__ import annotations

import contextlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posecast_wire import Schema, SchemaError, build_schema_text, fnv1a32

from .streams import SLOW, schemas


def test_layout() -> None:
    text = build_schema_text(
        "hubo",
        {"joint": ["RKN", "LKN"], "axis": ("torso.x",)},
        [
            {"name": "ref", "labels": "joint", "unit": "rad", "scale": 0.001, "rel": None, "bits": ()},
            {"name": "gyro", "labels": "axis", "slow": True},
            {"name": "pos", "labels": "joint", "rel": "ref", "slow": False},
            {"name": "flags", "labels": "joint", "bits": ("homed", "jam")},
        ],
        {"names": {"RKN": "right knee"}},
    )
    schema = Schema.parse(text)
    assert [(f.name, f.start, f.size) for f in schema.fields] == [
        ("ref", 0, 2), ("gyro", 2, 1), ("pos", 3, 2), ("flags", 5, 2),
    ]  # fmt: skip
    assert schema.size == 7
    assert schema.id == fnv1a32(text.encode())
    assert schema.find_field("pos") is schema.fields[2]
    assert schema.find_field("vel") is None
    assert json.loads(text)["fields"][2] == {"name": "pos", "labels": "joint", "rel": "ref"}
    assert json.loads(text)["fields"][0] == {"name": "ref", "labels": "joint", "unit": "rad", "scale": 0.001}


def test_unknown_members_are_ignored() -> None:
    doc = {"type": "schema", "v": 1, "robot": "r", "more": 1, "labels": {"j": ["a"]}}
    fields = [{"name": "f", "labels": "j", "more": 2}]
    assert Schema.parse(json.dumps(doc | {"fields": fields})).size == 1


def test_too_many_channels() -> None:
    labels = {"j": [str(i) for i in range(2049)]}
    with pytest.raises(SchemaError, match=r"fields\[1\]: more than 4096 channels"):
        build_schema_text("r", labels, [{"name": "a", "labels": "j"}, {"name": "b", "labels": "j"}])


def test_too_long() -> None:
    with pytest.raises(SchemaError, match="longer than 262144 bytes"):
        Schema.parse(" " * 262_145)


def test_a_label_set_has_no_more_names_than_channels() -> None:
    labels = {"j": ["x"], "k": [str(i) for i in range(4097)]}
    with pytest.raises(SchemaError, match=r"labels\.k: more than 4096 names"):
        build_schema_text("r", labels, [{"name": "a", "labels": "j"}])


def test_names_are_quoted_in_one_short_line_with_nothing_unseen() -> None:
    labels = {"j": ["\u202e\u200b" * 100] * 2}
    with pytest.raises(SchemaError) as caught:
        build_schema_text("r", labels, [{"name": "a", "labels": "j"}])
    assert str(caught.value).startswith(r"labels.j: '\u{202e}\u{200b}")
    assert str(caught.value).endswith("appears twice")
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 2_000


def test_half_a_surrogate_is_no_text() -> None:
    with pytest.raises(SchemaError, match="not JSON"):
        Schema.parse('{"type":"\ud800"}')


def test_what_json_cannot_say() -> None:
    with pytest.raises(SchemaError, match="not JSON"):
        build_schema_text("r", {"j": ["a"]}, [{"name": "a", "labels": "j", "scale": float("nan")}])
    with pytest.raises(SchemaError, match="not JSON"):
        build_schema_text("r", {"j": ["a"]}, [{"name": "a", "labels": "j", "unit": object()}])


@SLOW
@given(schemas(), st.data())
def test_a_mutilated_schema_is_refused_or_read_never_a_crash(schema: Schema, data: st.DataObject) -> None:
    at = data.draw(st.integers(0, len(schema.text) - 1))
    mutilated = schema.text[:at] + data.draw(st.text(max_size=3)) + schema.text[at + 1 :]
    with contextlib.suppress(SchemaError):
        Schema.parse(mutilated)


NAMES = st.sampled_from(["type", "v", "labels", "fields", "mapping", "joints", "terms", "a"])
LEAVES = st.none() | st.booleans() | st.floats() | st.text(max_size=5)
JSON = st.recursive(LEAVES, lambda s: st.lists(s, max_size=3) | st.dictionaries(NAMES, s, max_size=4))


@SLOW
@given(JSON)
def test_any_json_is_refused_in_one_way(document: object) -> None:
    with pytest.raises(SchemaError):
        Schema.parse(json.dumps(document))
