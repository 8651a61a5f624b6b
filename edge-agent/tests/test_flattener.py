from __future__ import annotations

import pytest
from posecast_edge.kit import PartLog
from posecast_edge.pipeline.stream import MAX_NAMED, SampleFlattener
from posecast_edge.sample import Sample
from posecast_wire.schema import Schema, build_schema_text

SCHEMA = Schema.parse(
    build_schema_text(
        "r",
        {"joint": ["A", "B"]},
        [
            {"name": "pos", "labels": "joint", "unit": "rad", "scale": 0.001},
            {"name": "flags", "labels": "joint", "bits": ["homed", "jam"]},
        ],
    )
)


def flatten(
    values: dict[str, object], flattener: SampleFlattener | None = None
) -> tuple[list[float | None], list[str]]:
    said: list[str] = []
    used = flattener or SampleFlattener(SCHEMA, said.append)
    return used.flatten(Sample(0.0, values, {}, "line 7")), said  # type: ignore[arg-type]


def test_by_label_and_in_order() -> None:
    assert flatten({"pos": {"B": 2.0}, "flags": [3, 0]}) == ([None, 2.0, 3, 0], [])
    assert flatten({"pos": [1.0, None]}) == ([1.0, None, None, None], [])


def test_flags_as_names_or_mask() -> None:
    assert flatten({"flags": {"A": ["jam"], "B": ["jam", "homed"]}})[0] == [None, None, 2, 3]
    assert flatten({"flags": [[], None]})[0] == [None, None, 0, None]


def test_an_item_that_is_no_name_costs_that_item() -> None:
    assert flatten({"flags": {"A": ["jam", 5]}}) == (
        [None, None, 2, None],
        ["line 7: flags.A has 5, not the name of a bit"],
    )


def test_wrong_count_is_named_and_shifts_nothing() -> None:
    assert flatten({"pos": [1.0, 2.0, 3.0], "flags": [1, 0]}) == (
        [None, None, 1, 0],
        ["line 7: pos has 3 values, 2 expected"],
    )


def test_what_is_no_number_is_named_and_has_no_reading() -> None:
    assert flatten({"pos": ["x", 1.0]}) == ([None, 1.0, None, None], ["line 7: pos.A is 'x', not a number"])
    assert flatten({"pos": [10**400, [1]]})[0] == [None] * 4
    assert flatten({"flags": [4, -1]}) == (
        [None] * 4,
        [f"line 7: flags.{which}, not a list or mask of its bits" for which in ("A is 4", "B is -1")],
    )
    assert flatten({"flags": [1.5, "jam"]})[0] == [None] * 4
    assert flatten({"pos": {"A": True}, "flags": [False, 1]}) == (
        [None, None, None, 1],
        ["line 7: pos.A is True, not a number", "line 7: flags.A is False, not a list or mask of its bits"],
    )


@pytest.mark.parametrize("too_large", [1e300, -1e12, 268_436.0, 10**12])
@pytest.mark.parametrize("in_order", [True, False])
def test_a_value_that_no_code_has_is_named_and_has_no_reading(too_large: float, in_order: bool) -> None:
    given: object = [too_large, 268_435.0] if in_order else {"A": too_large, "B": 268_435.0}
    assert flatten({"pos": given}) == (
        [None, 268_435.0, None, None],
        [f"line 7: pos.A is {too_large:g}, beyond ±268435 rad"],
    )
    assert flatten({"pos": [float("inf"), float("-inf")]})[1] == []


def test_another_problem_of_a_channel_is_named_too() -> None:
    said: list[str] = []
    flattener = SampleFlattener(SCHEMA, said.append)
    for n in range(9):
        flatten({"pos": {"A": f"x, {n}" if n % 2 else 1e9 + n}}, flattener)
    assert said == ["line 7: pos.A is 1e+09, beyond ±268435 rad", "line 7: pos.A is 'x, 1', not a number"]


def test_what_is_said_of_a_value_is_short_whatever_it_is() -> None:
    deep: list[object] = []
    for _ in range(100_000):
        deep = [deep]
    for value in (10**5000, deep, "\u202e" * 10_000, ["x"] * 100_000):
        [line] = flatten({"pos": [value, 1.0]})[1]
        assert len(line) < 100
        assert line.isprintable()
    [line] = flatten({"pos": {"\u202e" * 10_000: 1.0}})[1]
    assert len(line) < 120
    assert line.isprintable()


def test_unknown_names_are_said_once_and_at_most_so_many() -> None:
    said: list[str] = []
    flattener = SampleFlattener(SCHEMA, said.append)
    for _ in range(3):
        flatten({"pos": {"A": 1.0, "C": 2.0}, "hue": [1], "flags": {"A": ["odd"]}}, flattener)
    assert said == [
        "line 7: unknown label of pos 'C' is ignored",
        "line 7: unknown field 'hue' is ignored",
        "line 7: unknown bit of flags 'odd' is ignored",
    ]
    for i in range(1000):
        flatten({f"f{i}": [1]}, flattener)
    assert len(said) == MAX_NAMED
    assert "further unknown names" in said[-1]


def test_a_wrong_value_is_named_once_also_by_a_later_schema() -> None:
    said: list[str] = []
    wrong = PartLog(said.append, "wrong values")
    for i in range(400):
        flattener = SampleFlattener(SCHEMA, said.append, wrong=wrong)
        flattener.flatten(Sample(0.0, {"pos": [1.0], "flags": {"A": -1, "B": "x"}}, {}, f"line {i}"))
    assert said[:3] == [
        "line 0: pos has 1 value, 2 expected",
        "line 0: flags.A is -1, not a list or mask of its bits",
        "line 0: flags.B is 'x', not a list or mask of its bits",
    ]
    assert [text.partition(" more wrong values, the newest: line ")[0] for text in said[3:]] == [
        *("10", "100", "1000")
    ]
