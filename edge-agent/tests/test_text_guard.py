"""The first door for text, and that every source goes through it."""

from __future__ import annotations

import json

import pytest
from posecast_edge.pipeline.text_guard import TextGuard
from posecast_edge.profile.schema import infer_profile, make_schema_text
from posecast_edge.sample import Sample, Values
from posecast_wire.schema import Schema

HALF = "\ud800"


def guarded(sample: Sample) -> tuple[Sample, list[str]]:
    said: list[str] = []
    return TextGuard(said.append).clean(sample, 0.0), said


def test_a_text_that_is_none_is_named_and_the_others_stay() -> None:
    sample, said = guarded(
        Sample(
            1.0,
            {"pos": [1.0]},
            {"mode": HALF, HALF: "x", "ok": "é😀"},
            "line 7",
            links={"imu": "torso" + HALF},
        )
    )
    assert sample == Sample(1.0, {"pos": [1.0]}, {"ok": "é😀"}, "line 7")
    assert said == ["line 7: info 'mode' is left out: it is not valid Unicode (half of a surrogate pair)"]


def test_a_name_that_turns_the_line_is_shown_escaped() -> None:
    said: list[str] = []
    TextGuard(said.append).clean_names(Sample(0.0, {"\u202etorque": {HALF: 2.0}}), 0.0)
    assert said == [
        "'\\u202etorque'.'\\ud800' is left out: it is not valid Unicode (half of a surrogate pair)"
    ]


def test_it_is_said_once_and_counted() -> None:
    said: list[str] = []
    guard = TextGuard(said.append)
    for i in range(600):
        guard.clean(Sample(0.0, {}, {"mode": f"{HALF}{i}"}, f"line {i}"), i / 500)
    assert len(said) == 2
    assert " more invalid names and texts, the newest: line " in said[1]


@pytest.mark.parametrize("text", [b"bytes", 5, None])
def test_what_is_not_even_a_string(text: object) -> None:
    sample, said = guarded(Sample(0.0, {}, {"mode": text}))  # type: ignore[dict-item]
    assert (sample.info, len(said)) == ({}, 1)


def test_a_schema_is_made_of_the_names_that_are_texts() -> None:
    said: list[str] = []
    values: dict[str, Values] = {
        "pos": {"A": 1.0, HALF: 2.0},
        f"po{HALF}": {"A": 1.0},
        "flags": {"A": ["jam", HALF]},
        "order": [1.0, 2.0],
    }
    named = TextGuard(said.append).clean_names(Sample(0.0, values, where="line 1"), 0.0)
    assert named.values == {"pos": {"A": 1.0}, "flags": {"A": ["jam"]}, "order": [1.0, 2.0]}
    assert said == ["line 1: 'pos'.'\\ud800' is left out: it is not valid Unicode (half of a surrogate pair)"]
    del named.values["order"]  # type: ignore[attr-defined]
    schema = Schema.parse(make_schema_text(infer_profile("r", named)))
    json.loads(schema.text.encode())
    assert [(f.name, f.labels) for f in schema.fields] == [("pos", ("A",)), ("flags", ("A",))]
