"""Inboxes of robots: bounded, emptied in turns."""

from __future__ import annotations

import random
from itertools import permutations

import pytest
from posecast_relay.zenoh.ingest import (
    BYTES_MAX,
    MESSAGES_MAX,
    OTHERS,
    ROBOTS_MAX,
    Importance,
    Inboxes,
    Message,
)

FRAME, ANSWER, EVENT, TOKEN = Importance


def put(
    inboxes: Inboxes, robot: str, said: list[str], what: str, size: int = 10, importance: Importance = EVENT
) -> None:
    """A message that says its name when it is taken in."""
    inboxes.put(robot, Message(lambda: said.append(what), size, importance), 0.0)


def empty(inboxes: Inboxes) -> None:
    """Take all in."""
    while (message := inboxes.pop()) is not None:
        message.take_in()


def test_robots_take_turns() -> None:
    inboxes, said = Inboxes(), list[str]()
    for n in range(100):
        put(inboxes, "flood", said, f"f{n}")
    put(inboxes, "a", said, "a0")
    put(inboxes, "b", said, "b0")
    put(inboxes, "a", said, "a1")
    empty(inboxes)
    assert said[:7] == ["f0", "a0", "b0", "f1", "a1", "f2", "f3"]
    assert len(said) == 103
    assert not inboxes


def test_a_full_inbox_loses_its_own_oldest() -> None:
    inboxes, said = Inboxes(), list[str]()
    put(inboxes, "a", said, "a0")
    for n in range(MESSAGES_MAX + 10):
        put(inboxes, "flood", said, f"f{n}")
    empty(inboxes)
    assert said[:2] == ["a0", "f10"]
    assert inboxes.take_lost() == {"flood": 10}
    assert inboxes.take_lost() == {}


def test_an_inbox_is_bounded_in_bytes() -> None:
    inboxes, said = Inboxes(), list[str]()
    for n in range(40):
        put(inboxes, "flood", said, f"f{n}", size=BYTES_MAX // 4)
    empty(inboxes)
    assert said == ["f36", "f37", "f38", "f39"]
    put(inboxes, "big", said, "the largest", size=BYTES_MAX + 1)
    empty(inboxes)
    assert said[-1] == "the largest"


@pytest.mark.parametrize("size", [10, BYTES_MAX // 100])
def test_a_full_inbox_loses_frames_before_all_else(size: int) -> None:
    """As when the loop stands still for seconds."""
    inboxes, said = Inboxes(), list[str]()
    others = {"token": TOKEN, "echo": ANSWER, "fault on": EVENT, "fault off": EVENT, "gone": TOKEN}
    for n, (what, importance) in enumerate(others.items()):
        put(inboxes, "r", said, what, importance=importance)
        for k in range(2 * MESSAGES_MAX):
            put(inboxes, "r", said, f"{n}/{k}", size, FRAME)
    empty(inboxes)
    assert [what for what in said if what in others] == list(others)
    frames = [what for what in said if what not in others]
    assert frames == [f"4/{k}" for k in range(2 * MESSAGES_MAX)][-len(frames) :]  # the newest, in order
    assert inboxes.take_lost() == {"r": 10 * MESSAGES_MAX - len(frames)}
    assert 90 < len(frames) < MESSAGES_MAX


@pytest.mark.parametrize(("first", "second"), list(permutations(Importance, 2)))
def test_what_is_less_important_is_lost_first_whatever_came_first(
    first: Importance, second: Importance
) -> None:
    inboxes, said = Inboxes(), list[str]()
    for importance in (first, second):
        for n in range(MESSAGES_MAX):
            put(inboxes, "r", said, f"{importance.name} {n}", importance=importance)
    empty(inboxes)
    assert said == [f"{max(first, second).name} {n}" for n in range(MESSAGES_MAX)]


def test_what_is_left_keeps_its_order() -> None:
    inboxes, said, chance = Inboxes(), list[str](), random.Random(7)
    sent = [(n, chance.choices(list(Importance), (20, 2, 2, 1))[0]) for n in range(4 * MESSAGES_MAX)]
    for n, importance in sent:
        put(inboxes, "r", said, f"{n}", importance=importance)
    empty(inboxes)
    got = [int(what) for what in said]
    assert got == sorted(got)
    assert len(got) == MESSAGES_MAX
    for importance in (ANSWER, EVENT, TOKEN):  # there were enough frames to lose
        assert {n for n, its in sent if its is importance} <= set(got)
    assert not inboxes


def test_a_closed_inbox_takes_no_frames_but_all_else() -> None:
    inboxes, said = Inboxes(), list[str]()
    put(inboxes, "r", said, "frame", importance=FRAME)
    put(inboxes, "r", said, "event")
    inboxes.close("r", 0.0, until=1.0)
    put(inboxes, "r", said, "late frame", importance=FRAME)
    put(inboxes, "r", said, "token")
    inboxes.put("r", Message(lambda: said.append("frame again"), 1, FRAME), 1.0)
    empty(inboxes)
    assert said == ["event", "token", "frame again"]
    assert inboxes.take_lost() == {"r": 2}


def test_the_number_of_inboxes_is_bounded() -> None:
    inboxes, said = Inboxes(), list[str]()
    for n in range(ROBOTS_MAX + 5):
        put(inboxes, f"r{n}", said, "x")
    assert inboxes.take_lost() == {OTHERS: 5}
    empty(inboxes)
    assert len(said) == ROBOTS_MAX


def test_robots_that_went_while_they_were_closed_are_forgotten() -> None:
    inboxes = Inboxes()
    for n in range(3 * ROBOTS_MAX):
        inboxes.close(f"r{n}", float(n), until=n + 0.01)
    assert len(inboxes._closed_until) <= ROBOTS_MAX
