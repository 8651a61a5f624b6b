"""One bound for all that is here or on its way, shared among robots. The clock is passed in."""

from __future__ import annotations

import asyncio
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from posecast_relay.models.memory import ENTRY_BYTES, IN_USE_S, Claim, ModelMemory

KB = 1000


class Clock:
    """Stands still unless it is told to go on."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def put(room: ModelMemory, robot: str, name: str, size: int) -> bool:
    """Keep a file of a robot; False when there was no room."""
    claim = room.claim(robot, size, lambda: None)
    if claim is None:
        return False
    room.keep(claim, name, bytes(size), size)
    room.release(claim)
    return True


def here(room: ModelMemory, *names: str) -> str:
    """Which of these are, without asking for them."""
    return "".join(name for name in names if name in room._kept)


def test_what_nobody_asked_for_lately_goes_first_whoever_has_it() -> None:
    clock = Clock()
    room = ModelMemory(300 * KB + 3 * ENTRY_BYTES, clock)
    for name in "abc":
        assert put(room, name, name, 100 * KB)
    clock.now = IN_USE_S
    assert room.get("a") is not None
    assert put(room, "d", "d", 100 * KB)
    assert here(room, "a", "b", "c", "d") == "acd"
    assert room.used == room.most


def test_a_robot_takes_its_own_before_others_and_no_more_than_others_have() -> None:
    room = ModelMemory(400 * KB, Clock())
    assert put(room, "other", "o", 150 * KB)
    assert put(room, "greedy", "1", 100 * KB)
    assert put(room, "greedy", "2", 100 * KB)
    assert put(room, "greedy", "3", 100 * KB)
    assert here(room, "o", "1", "2", "3") == "o23"
    assert not put(room, "greedy", "4", 300 * KB)  # the other has less than that
    assert here(room, "o", "2", "3") == "o23", "nothing was taken in vain"
    assert put(room, "new", "n", 120 * KB)  # greedy has more
    assert here(room, "o", "2", "3", "n") == "o3n"


def test_what_is_under_way_for_who_has_more_gives_way() -> None:
    room, given_up = ModelMemory(300 * KB, Clock()), list[str]()
    first = room.claim("greedy", 140 * KB, lambda: given_up.append("first"))
    second = room.claim("greedy", 140 * KB, lambda: given_up.append("second"))
    assert first is not None
    assert second is not None
    assert room.claim("greedy", 140 * KB, lambda: None) is None
    assert put(room, "modest", "m", 50 * KB)
    assert given_up == ["second"]
    room.keep(second, "late", b"", 0)  # what comes of it all the same is not kept
    room.release(second)
    assert here(room, "late", "m") == "m"
    room.keep(first, "f", b"", 100 * KB)
    room.release(first)
    assert room.used == 150 * KB + 2 * ENTRY_BYTES


async def test_who_waits_hears_when_something_has_gone() -> None:
    room = ModelMemory(100 * KB, Clock())
    claim = room.claim("a", 90 * KB, lambda: None)
    assert claim is not None
    waiting = [asyncio.create_task(room.wait_for_release()) for _ in range(3)]
    await asyncio.sleep(0)
    waiting[0].cancel()
    await asyncio.sleep(0)
    assert not any(each.done() for each in waiting[1:])
    room.release(claim)
    await asyncio.gather(*waiting[1:])


STEPS = st.lists(
    st.tuples(
        st.sampled_from(["claim", "keep", "release", "get", "wait"]),
        st.sampled_from("abc"),
        st.integers(0, 400 * KB),
    ),
    max_size=60,
)


@given(STEPS)
@settings(deadline=None)
def test_the_bound_holds_whatever_happens(steps: list[tuple[str, str, int]]) -> None:
    clock = Clock()
    room, open_claims, names = ModelMemory(500 * KB, clock), list[Claim](), 0
    for what, robot, size in steps:
        if what == "claim":
            made: list[Any] = []
            claim = room.claim(robot, size, lambda made=made: open_claims.remove(made[0]))  # type: ignore[misc]
            if claim is not None:
                made.append(claim)
                open_claims.append(claim)
        elif what == "get":
            room.get(str(size % max(1, names)))
        elif what == "wait":
            clock.now += size / 10 / KB
        elif open_claims:
            claim = open_claims[size % len(open_claims)]
            if what == "keep" and claim.size > ENTRY_BYTES:
                room.keep(claim, str(names), bytes(1), min(size, claim.size - ENTRY_BYTES))
                names += 1
            room.release(claim)
            open_claims.remove(claim)
        kept = [each.size for each in room._kept.values()]
        assert room.used == sum(kept) + sum(claim.size for claim in open_claims) <= room.most
        assert room.used == room._sums.total()
