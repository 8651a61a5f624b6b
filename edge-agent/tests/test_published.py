"""Between a program that publishes and the agent: what is copied, what is kept, in which order it is told."""

from __future__ import annotations

import logging
import math
import threading
from typing import Any

import numpy as np
import pytest
from posecast_edge.sample import Sample
from posecast_edge.sources.published.checks import MORE, PROBLEMS_MAX, ProblemList
from posecast_edge.sources.published.readings import (
    KEPT_MAX,
    NAMES_MAX,
    PUBLISHERS_MAX,
    Copied,
    PublishedSlot,
    ReadingsCopier,
    Taken,
    UnusableError,
    copy_base,
)
from posecast_edge.sources.published.source import PublishedSource


def copier(said: list[str], **orders: tuple[str, ...]) -> ReadingsCopier:
    return ReadingsCopier(orders, ["flags"], said.append)


@pytest.mark.parametrize(
    ("values", "readings"),
    [
        ({"a": 1.0, "b": None}, [1.0, None]),
        ({"a": 1, "b": np.float32(0.5)}, [1.0, 0.5]),
        ([1.0, 2.0], [1.0, 2.0]),
        ((1, None), [1.0, None]),
        (np.array([1, 2]), [1.0, 2.0]),
        (np.array([[1.0, 9.0], [2.0, 9.0]])[:, 0], [1.0, 2.0]),
    ],
)
def test_what_is_copied_are_floats(values: Any, readings: list[float | None]) -> None:
    said: list[str] = []
    copied = copier(said, pos=("a", "b")).copy_field("pos", values)
    assert (copied.labels, list(copied.readings)) == (("a", "b"), readings)
    assert {type(r) for r in copied.readings} <= {float, type(None)}
    assert said == []


def test_a_copy_does_not_follow_its_original() -> None:
    values, array = {"a": 1.0}, np.zeros(1)
    own = copier([], ref=("a",))
    copies = [own.copy_field("pos", values), own.copy_field("ref", array)]
    values["a"] = values["b"] = array[0] = 9.0
    assert [(c.labels, list(c.readings)) for c in copies] == [(("a",), [1.0]), (("a",), [0.0])]


def test_one_wrong_value_leaves_the_others() -> None:
    said: list[str] = []
    copied = copier(said).copy_field("pos", {"a": "x", "b": 2, "c": object()})
    assert list(copied.readings) == [None, 2.0, None]
    assert said == ["pos of 'a' is 'x', not a number", "pos of 'c' is of type object, not a number"]
    flags = copier(said).copy_field("flags", {"a": ["jam"], "b": 3, "c": {"hot"}, "d": -1})
    assert list(flags.readings) == [["jam"], 3, ["hot"], None]


def test_of_too_many_names_those_that_were_there_stay() -> None:
    said: list[str] = []
    own = copier(said)
    own.copy_field("pos", {"elbow": 1.0})
    many: dict[str, float] = {f"j{k}": 0.0 for k in range(5000)}
    assert own.copy_field("pos", {**many, "elbow": 1.0}).labels == (*many, "elbow"), "the agent decides"
    assert said == []
    own.copy_field("pos", {"elbow": 1.0})
    many = {f"j{k}": 0.0 for k in range(NAMES_MAX)}
    for _ in range(2):
        assert own.copy_field("pos", {**many, "elbow": 1.0}).labels == ("elbow", *tuple(many)[:-1])
    assert set(said) == {f"pos has more than {NAMES_MAX} names; the rest is left out"}


def test_one_wrong_bit_leaves_the_others() -> None:
    said: list[str] = []
    many = [f"bit {n}" for n in range(40)]
    flags = copier(said).copy_field("flags", {"a": ["jam", 5, None], "b": {"hot"}, "c": many})
    assert list(flags.readings) == [["jam"], ["hot"], sorted(many)]
    assert said == [
        "flags of 'a' has an item of type int, not the name of a bit",
        "flags of 'a' has None, not the name of a bit",
    ]


def test_a_base_is_seven_numbers() -> None:
    assert copy_base([1, 2, 3, 4, 5, 6, 7]) == [
        Copied("base", ("base.x", "base.y", "base.z"), [1.0, 2.0, 3.0]),
        Copied("baseq", ("base.x", "base.y", "base.z", "base.w"), [4.0, 5.0, 6.0, 7.0]),
    ]
    for wrong in ([1, 2], "1234567", None, 7, [1] * 8):
        with pytest.raises(UnusableError):
            copy_base(wrong)


def taken(slot: PublishedSlot, now_s: float) -> Taken:
    found = slot.take(now_s)
    assert found is not None
    return found


def test_the_newest_wins_and_what_is_not_named_stays_for_a_while() -> None:
    slot = PublishedSlot()
    slot.put(1.0, [Copied("pos", ("a",), [1.0]), Copied("temp", ("a",), [40.0])], {}, 10.0)
    slot.put(2.0, [Copied("pos", ("a",), [2.0])], {"mode": "x"}, 11.0)
    slot.put(3.0, [Copied("pos", ("b",), [3.0])], {}, 12.0)
    assert taken(slot, 12.0) == (3.0, {"temp": {"a": 40.0}, "pos": {"a": 2.0, "b": 3.0}}, {"mode": "x"}, [])
    assert slot.take(12.0) is None
    slot.put(4.0, [Copied("pos", ("b",), [4.0])], {}, 12.6)
    assert taken(slot, 12.6).values == {"temp": {"a": 40.0}, "pos": {"b": 4.0}}
    slot.put(5.0, [Copied("pos", ("b",), [5.0])], {}, 71.0)
    assert taken(slot, 71.0).values == {"pos": {"b": 5.0}}


def test_flags_that_were_replaced_unseen_are_kept_and_not_too_many() -> None:
    slot = PublishedSlot()
    for i in range(3):
        for _ in range(5):
            slot.put(float(i), [Copied("flags", ("a",), [i])], {}, 0.0)
    assert taken(slot, 0.0).flags == [(0.0, {"a": 0}), (1.0, {"a": 1})]
    for i in range(10 * KEPT_MAX):
        slot.put(float(i), [Copied("flags", ("a",), [i])], {}, 0.0)
    kept = taken(slot, 0.0).flags
    assert [t_s for t_s, _ in kept] == list(range(9 * KEPT_MAX - 1, 10 * KEPT_MAX - 1))


def test_calls_that_always_name_others_take_no_more_room() -> None:
    slot = PublishedSlot()
    for i in range(10 * PUBLISHERS_MAX):
        slot.put(0.0, [Copied("pos", (f"a{i}",), [1.0])], {}, 0.0)
    assert len(taken(slot, 0.0).values["pos"]) == PUBLISHERS_MAX


def test_who_waits_is_woken_by_the_next_call() -> None:
    slot = PublishedSlot()
    waiting = threading.Thread(target=slot.wait, args=(60.0,))
    waiting.start()
    while not slot._waiting:
        pass
    slot.put(0.0, [Copied("pos", ("a",), [1.0])], {}, 0.0)
    waiting.join(10)
    assert not waiting.is_alive()
    slot.wait(60.0)  # something lies there


def test_problems_are_counted_and_said_once(caplog: pytest.LogCaptureFixture) -> None:
    problems = ProblemList()
    with caplog.at_level(logging.WARNING, "posecast_edge.robot"):
        for i in range(PROBLEMS_MAX + 20):
            problems.add(f"problem {i}")
            problems.add("one\nline")
            problems.log_new()
    counts = problems.get_counts()
    assert (len(counts), counts[MORE], counts["one\\nline"]) == (PROBLEMS_MAX + 1, 21, PROBLEMS_MAX + 20)
    assert len(caplog.records) == PROBLEMS_MAX + 1


def test_joints_stand_in_the_order_of_the_constructor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("posecast_edge.sources.published.source.SETTLE_S", 0.0)
    slot, problems, got = PublishedSlot(), ProblemList(), list[Sample]()
    source = PublishedSource(slot, ("b", "a"), None, problems)
    slot.put(1.0, [Copied("ref", ("a", "c"), [math.nan, 1.0]), Copied("temp", ("a",), [1.0])], {}, 0.0)

    def deliver(sample: Sample) -> None:
        got.append(sample)
        source.end()

    monkeypatch.setattr("posecast_edge.kit.now_s", lambda: 0.0)
    source.run(deliver, threading.Event())
    empty = {"b": None, "a": None}
    assert got == [Sample(1.0, {"pos": empty, "ref": empty, "temp": {"b": None, "a": 1.0}})]
    assert list(got[0].values["pos"]) == ["b", "a"]
    assert problems.get_counts() == {
        "ref of 'a' is nan, which is not a reading": 1,
        "ref of 'c' is left out: it is not in joints=[…]": 1,
    }
