"""What channels mean. Joint values stand in the vectors."""

from __future__ import annotations

import math

import pytest
from posecast_wire import (
    BalanceRule,
    JointMap,
    Schema,
    SchemaError,
    SensorMount,
    Sentence,
    Threshold,
    build_schema_text,
    compute_joint_values,
)
from posecast_wire.schema import parse_mapping

MAPPED = Schema.parse(
    build_schema_text(
        "r",
        {"joint": ["LSR", "RKN"]},
        [{"name": "pos", "labels": "joint", "scale": 0.001}],
        {
            "joints": {"LSR": {"terms": [["LSR", 1.0]], "offset": 0.25}},
            "sensors": {
                "RF": {"kind": "wrench", "name": "right foot", "link": "foot", "xyz": [0, 0, 1]},
                "main": {"kind": "power"},
            },
            "names": {"RKN": "right knee"},
            "translated_names": {"ko": {"RKN": "오른쪽 무릎"}},
            "thresholds": {"temp": {"*": {"high": 70}, "RKN": {"high": 80, "caution": 0.9}}},
            "tolerance": {"*": 0.05, "RKN": 0.08},
            "severity": {"flags": {"homed": "state"}},
            "units": {"pos": {"NK1": "mm"}},
            "explain": {"flags": {"jam": {"en": {"say": "{joint} is stuck.", "why": "It hit something."}}}},
        },
    )
)


def test_sentences_are_as_many_and_as_long_as_the_page_can_take() -> None:
    full = {f"b{n}": {"en": {"say": "🦾" * 200, "why": "🦾" * 200}} for n in range(20)}
    most = {"a": full | {"last": {"en": {"say": "🦾" * 192}}}}
    found = parse_mapping({"explain": most}).sentences["a"]
    assert sum(len(((s := of["en"]).say + (s.why or "")).encode()) for of in found.values()) == 32 << 10
    with pytest.raises(SchemaError, match=r"mapping\.explain: more than 32768 bytes of sentences in all"):
        parse_mapping({"explain": most | {"b": {"jam": {"en": {"say": "x"}}}}})
    languages = {f"x{n}": {"say": "x"} for n in range(17)}
    with pytest.raises(SchemaError, match=r"mapping\.explain\.a\.jam: more than 16 languages"):
        parse_mapping({"explain": {"a": {"jam": languages}}})
    languages.pop("x0")
    assert len(parse_mapping({"explain": {"a": {"jam": languages}}}).sentences["a"]["jam"]) == 16


def test_parts() -> None:
    mapping = MAPPED.mapping
    assert mapping.joints == {"LSR": JointMap((("LSR", 1.0),), 0.25)}
    assert mapping.sensors == {
        "RF": SensorMount("wrench", "right foot", "foot", (0.0, 0.0, 1.0)),
        "main": SensorMount("power", "main", None),
    }
    assert mapping.names == {"RKN": "right knee"}
    assert mapping.translated_names == {"ko": {"RKN": "오른쪽 무릎"}}
    assert mapping.find_threshold("temp", "RKN") == Threshold(None, 80.0, 0.9)
    assert mapping.find_threshold("temp", "LKN") == Threshold(None, 70.0)
    assert mapping.find_threshold("cur", "RKN") is None
    assert (mapping.find_tolerance("RKN"), mapping.find_tolerance("LKN")) == (0.08, 0.05)
    assert (mapping.find_severity("flags", "homed"), mapping.find_severity("flags", "jam")) == (
        "state",
        "fault",
    )
    assert (
        mapping.find_unit("pos", "NK1"),
        mapping.find_unit("pos", "RKN"),
        mapping.find_unit("cur", "NK1"),
    ) == (
        "mm",
        None,
        None,
    )


def test_sentences_are_by_field_bit_and_language() -> None:
    assert MAPPED.mapping.sentences == {
        "flags": {"jam": {"en": Sentence("{joint} is stuck.", "It hit something.")}}
    }


def test_joint_values_are_in_radians_by_urdf_name() -> None:
    assert compute_joint_values(MAPPED, [1000, -500], "pos") == {"LSR": 1.25, "RKN": -0.5}


@pytest.mark.parametrize(
    ("threshold", "levels"),
    [
        (Threshold(-30, 500, 0.5), {-31: "fault", -16: "caution", -15: "ok"}),
        (Threshold(-30, 500, 0.5), {250: "ok", 251: "caution", 501: "fault"}),
        (Threshold(low=44, caution=0.88), {43.9: "fault", 49.9: "caution", 50.1: "ok"}),
        (Threshold(high=-10, caution=0.5), {-21: "ok", -19: "caution", -9: "fault"}),
        (Threshold(high=70), {70: "ok", 70.1: "fault"}),
        (Threshold(), {1e9: "ok"}),
        (Threshold(low=0, high=1), {math.nan: "ok", None: "ok"}),
    ],
)  # fmt: skip
def test_levels(threshold: Threshold, levels: dict[float | None, str]) -> None:
    assert {v: threshold.find_level(v) for v in levels} == levels


SOLE = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def test_what_the_robot_stands_on() -> None:
    rule = parse_mapping({"balance": {"feet": ["RF"], "ground": "measured", "soles": {"RF": SOLE}}}).balance
    assert rule == BalanceRule(("RF",), "measured", {"RF": ((0, 0, 0), (1, 0, 0), (0, 1, 0))})
    assert parse_mapping({}).balance == parse_mapping({"balance": None}).balance == BalanceRule()
    assert parse_mapping({"balance": {"feet": [], "later": 1}}).balance.feet == ()


@pytest.mark.parametrize(
    ("balance", "words"),
    [
        ([], "mapping.balance: must be an object"),
        ({"feet": "RF"}, "mapping.balance.feet: must be a list"),
        ({"feet": ["RF", "RF"]}, "mapping.balance.feet: 'RF' appears twice"),
        ({"feet": [str(n) for n in range(17)]}, "mapping.balance.feet: more than 16 names"),
        ({"ground": "air"}, "mapping.balance.ground: must be one of measured, lowest"),
        ({"ground": ["lowest"]}, "mapping.balance.ground: must be one of measured, lowest"),
        ({"soles": {"RF": SOLE[:2]}}, "mapping.balance.soles.RF: must have 3 to 64 corners"),
        ({"soles": {"RF": SOLE * 22}}, "mapping.balance.soles.RF: must have 3 to 64 corners"),
        ({"soles": {"RF": [*SOLE, [0, 0]]}}, "mapping.balance.soles.RF[3]: must be three numbers"),
        ({"soles": {"RF": [*SOLE, [0, 0, "0"]]}}, "mapping.balance.soles.RF[3][2]: must be a number"),
        ({"soles": {str(n): SOLE for n in range(17)}}, "mapping.balance.soles: more than 16 soles"),
    ],
)
def test_a_stance_that_is_none_is_named(balance: object, words: str) -> None:
    with pytest.raises(SchemaError) as raised:
        parse_mapping({"balance": balance})
    assert str(raised.value) == words
