"""What a program publishes becomes channels: at first, and what comes later, within bounds."""

from __future__ import annotations

from posecast_edge.sources.published.channels import FULL, GROW_EVERY_S, GROWTHS_MAX, PublishedChannels
from posecast_edge.sources.published.problems import ProblemList
from posecast_edge.sources.published.slot import Readings
from posecast_wire.schema import CHANNELS_MAX


def channels(
    joints: tuple[str, ...] = (), first: dict[str, Readings] | None = None
) -> tuple[PublishedChannels, ProblemList]:
    problems = ProblemList()
    made = PublishedChannels("r1", joints, None, problems)
    made.learn(first or {"pos": {"a": 0.0}})
    return made, problems


def names(made: PublishedChannels) -> dict[str, set[str]]:
    return {name: set(labels) for name, labels in (made.labels or {}).items()}


def test_a_field_and_a_joint_that_come_later_are_added_once() -> None:
    made, problems = channels()
    assert names(made) == {"pos": {"a"}}
    now = {"pos": Readings(a=0.0, b=0.0), "effort": Readings(a=1.0)}
    assert made.grow(now, 10.0)
    assert names(made) == {"pos": {"a", "b"}, "effort": {"a", "b"}}
    assert not made.grow(now, 20.0)
    assert problems.get_counts() == {}


def test_at_most_once_a_second() -> None:
    made, _ = channels()
    grown = [made.grow({"pos": {f"j{k}": 0.0 for k in range(n)}}, n / 10) for n in range(1, 30)]
    assert [n for n, more in enumerate(grown) if more] == [0, 10, 20]
    assert names(made) == {"pos": {"a", *(f"j{k}" for k in range(21))}}


def test_who_makes_up_names_for_ever_gets_no_more_and_one_line() -> None:
    made, problems = channels()
    grown = sum(made.grow({"pos": {f"j{n}": 0.0}}, n * GROW_EVERY_S) for n in range(10 * GROWTHS_MAX))
    assert grown == GROWTHS_MAX
    assert made.labels is not None
    assert len(made.labels["pos"]) == GROWTHS_MAX + 1
    assert list(problems.get_counts()) == [FULL]


def test_schemas_are_bounded_in_bytes() -> None:
    made, problems = channels()
    n = 0
    while not made.is_full:
        made.grow({"volt": {f"{'x' * 90} {n} {k}": 0.0 for k in range(300)}}, n * GROW_EVERY_S)
        n += 1
    assert n < GROWTHS_MAX
    assert not made.grow({"pos": {"b": 0.0}}, n * GROW_EVERY_S)
    assert FULL in problems.get_counts()


def test_one_field_of_which_no_schema_can_be_made_leaves_the_others() -> None:
    made, problems = channels()
    huge: Readings = {f"s{k}": 0.0 for k in range(CHANNELS_MAX)}
    assert made.grow({"volt": huge, "amp": {"main": 1.0}}, 1.0)
    assert names(made) == {"pos": {"a"}, "amp": {"main"}}
    assert not made.grow({"volt": huge}, 2.0)
    assert made.grow({"volt": {"main": 1.0}}, 3.0)
    assert problems.get_counts() == {f"new names are left out: it names more than {CHANNELS_MAX} channels": 2}


def test_joints_of_the_constructor_are_all_there_are() -> None:
    made, problems = channels(("a", "b"), {"pos": {"a": 0.0, "b": 0.0, "c": 0.0}})
    assert names(made) == {"pos": {"a", "b"}}
    assert not made.grow({"pos": {"c": 0.0}}, 1.0)
    assert made.grow({"temp": {"a": 0.0, "c": 0.0}, "volt": {"c": 0.0}}, 2.0)
    assert names(made) == {"pos": {"a", "b"}, "temp": {"a", "b"}, "volt": {"c"}}
    assert made.explain_unknown("pos", "c") == "it is not in joints=[…]"
    assert problems.get_counts() == {}
