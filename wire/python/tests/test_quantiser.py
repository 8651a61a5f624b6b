"""Rounding, hysteresis, missing values, saturation."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posecast_wire import CODE_MAX, MISSING, Quantiser, Schema, build_schema_text

from .streams import SLOW

SCHEMA = Schema.parse(
    build_schema_text(
        "r",
        {"x": ["x"]},
        [
            {"name": "pos", "labels": "x", "scale": 0.001},
            {"name": "temp", "labels": "x"},
            {"name": "flags", "labels": "x", "bits": ["homed", "jam"]},
        ],
    )
)


def temps(quantiser: Quantiser, *values: float | None) -> list[int]:
    return [quantiser.quantise([0.0, v, 0])[1] for v in values]


def test_rounds_half_up() -> None:
    fresh = [Quantiser(SCHEMA, 0.0).quantise([v / 1000, v, 0])[1] for v in (-1.5, -0.5, 0.49, 0.5, 1.5)]
    assert fresh == [-1, 0, 0, 1, 2]


def test_a_code_moves_when_the_value_leaves_it_by_half_and_the_deadband() -> None:
    assert temps(Quantiser(SCHEMA, 0.3), 10.0, 10.7, 10.79, 10.81, 10.3, 10.21, 10.19) == [
        10, 10, 10, 11, 11, 11, 10,
    ]  # fmt: skip
    assert temps(Quantiser(SCHEMA, {"temp": 0.0}), 10.0, 10.51, 10.49) == [10, 11, 10]
    assert temps(Quantiser(SCHEMA, {"pos": 0.0}), 10.0, 10.51, 10.81) == [10, 10, 11]


@SLOW
@given(st.lists(st.floats(-1000, 1000), min_size=1, max_size=20), st.sampled_from([0.0, 0.3, 1.0]))
def test_the_error_never_passes_half_and_the_deadband(values: list[float], h: float) -> None:
    quantiser = Quantiser(SCHEMA, h)
    for v in values:
        assert abs(temps(quantiser, v)[0] - v) <= 0.5 + h + 1e-9


def test_no_reading_is_missing_and_comes_back() -> None:
    quantiser = Quantiser(SCHEMA)
    assert temps(quantiser, None, 3.0, math.nan, 3.4, math.inf, -math.inf, 10**400) == [
        MISSING, 3, MISSING, 3, MISSING, MISSING, MISSING,
    ]  # fmt: skip


def test_saturates_and_never_reads_as_missing() -> None:
    assert temps(Quantiser(SCHEMA), 1e300, -1e300, float(MISSING), float(CODE_MAX)) == [
        CODE_MAX, -CODE_MAX, -CODE_MAX, CODE_MAX,
    ]  # fmt: skip


def test_masks_have_no_deadband_and_must_be_whole() -> None:
    quantiser = Quantiser(SCHEMA, 5.0)
    masks: list[float | None] = [0, 1, 3, 2, True, CODE_MAX, CODE_MAX + 1, -1, 0.5, None, math.nan]
    assert [quantiser.quantise([0.0, 0.0, m])[2] for m in masks] == [
        0, 1, 3, 2, 1, CODE_MAX, MISSING, MISSING, MISSING, MISSING, MISSING,
    ]  # fmt: skip


def test_codes_are_the_callers_own() -> None:
    quantiser = Quantiser(SCHEMA)
    quantiser.quantise([1.0, 1.0, 1])[1] = 99
    assert quantiser.quantise([1.0, 1.0, 1]) == [1000, 1, 1]


def test_wrong_use_is_refused() -> None:
    with pytest.raises(ValueError, match="2 values for 3 channels"):
        Quantiser(SCHEMA).quantise([1.0, 2.0])
    with pytest.raises(ValueError, match="deadband of pos"):
        Quantiser(SCHEMA, {"pos": -1})


def test_a_channel_coarser_than_its_field_moves_in_multiples() -> None:
    schema = Schema.parse(
        build_schema_text("r", {"x": ["a", "b"]}, [{"name": "pos", "labels": "x", "scale": 0.0001}])
    )
    quantiser = Quantiser(schema, 0.3, {"pos": {"a": 10}})
    assert quantiser.quantise([0.0104, 0.0104]) == [100, 104]
    assert quantiser.quantise([0.01076, 0.01076]) == [100, 108]  # within half a step and the deadband
    assert quantiser.quantise([0.01085, None]) == [110, MISSING]
    assert quantiser.quantise([math.nan, 0.0]) == [MISSING, 0]
    assert quantiser.quantise([math.inf, 1e9]) == [MISSING, CODE_MAX]
    assert quantiser.quantise([-1e9, -1e9]) == [-(CODE_MAX // 10) * 10, -CODE_MAX]
    assert quantiser.quantise([10**400, 0.0])[0] == MISSING
