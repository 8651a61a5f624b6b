from __future__ import annotations

from posecast_edge.pipeline.flattener import MAX_NAMED, SampleFlattener
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
    return used.flatten(Sample(0.0, values, {}, "line 7"), 0.0), said  # type: ignore[arg-type]


def test_by_label_and_in_order() -> None:
    assert flatten({"pos": {"B": 2.0}, "flags": [3, 0]}) == ([None, 2.0, 3, 0], [])
    assert flatten({"pos": [1.0, None]}) == ([1.0, None, None, None], [])


def test_flags_as_names_or_mask() -> None:
    assert flatten({"flags": {"A": ["jam"], "B": ["jam", "homed"]}})[0] == [None, None, 2, 3]
    assert flatten({"flags": [[], None]})[0] == [None, None, 0, None]


def test_wrong_count_is_named_and_shifts_nothing() -> None:
    assert flatten({"pos": [1.0, 2.0, 3.0], "flags": [1, 0]}) == (
        [None, None, 1, 0],
        ["line 7: pos has 3 values, 2 expected"],
    )


def test_what_is_no_number_is_named_and_has_no_reading() -> None:
    assert flatten({"pos": ["x", 1.0]}) == (
        [None, 1.0, None, None],
        ["line 7: pos.A is 'x', not a number"],
    )
    assert flatten({"pos": [10**400, [1]]})[0] == [None] * 4
    assert flatten({"flags": [4, -1]}) == (
        [None] * 4,
        ["line 7: flags.A is 4, not a list or mask of its bits"],
    )
    assert flatten({"flags": [1.5, "jam"]})[0] == [None] * 4
    assert flatten({"pos": {"A": True}, "flags": [False, 1]}) == (
        [None, None, None, 1],
        ["line 7: pos.A is True, not a number"],
    )


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


def test_wrong_values_are_counted_once_a_second() -> None:
    said: list[str] = []
    flattener = SampleFlattener(SCHEMA, said.append)
    for i in range(400):
        flattener.flatten(Sample(0.0, {"pos": [1.0]}, {}, f"line {i}"), i / 200)
    assert said == [
        "line 0: pos has 1 values, 2 expected",
        "199 more wrong values, the newest: line 199: pos has 1 values, 2 expected",
    ]
