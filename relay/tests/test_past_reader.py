"""What somebody may see of what is kept, and what comes after a segment."""

from __future__ import annotations

from posecast_relay.core.policy import Audience, Grant, Policy, Principal, Rule
from posecast_relay.past.memory import MemoryPast
from posecast_relay.past.reading import HiddenSpans, NotYet, PastReader
from posecast_relay.past.segment import KeptSegment, SegmentName

from .past_doors import PAGE_MS, SCHEMA_HASH, make_kept

A = Audience.ANYONE
DARK, LIT = frozenset({Audience.LINK}), frozenset(Audience)
FIRST, SECOND, THIRD = 1, 2, 3  # takes


def grant(**rule: float) -> Grant:
    """What anyone gets."""
    found = Policy({"r": {A: Rule(**rule)}}).judge(Principal(), "r")  # type: ignore[arg-type]
    assert isinstance(found, Grant)
    return found


def keep(*segments: KeptSegment) -> PastReader:
    """In this order."""
    past = MemoryPast(1 << 24)
    for segment in segments:
        past.add(segment, 0.0)
    return PastReader(past, HiddenSpans(knows_all=True))


def kept(take: int, index: int, at: int, audiences: frozenset[Audience] = LIT) -> KeptSegment:
    """The one that is number `at` of all."""
    return make_kept(index, PAGE_MS + 4000 * at, take=take, audiences=audiences)


def name(take: int, index: int) -> SegmentName:
    """Of this robot and view."""
    return SegmentName("r", "public", take, index)


NOW_MS = PAGE_MS + 60_000


def test_what_comes_after_a_segment() -> None:
    # two takes; a hole in the first one, and one at the beginning of the second
    first = [kept(FIRST, index, index, DARK if index in (2, 3) else LIT) for index in range(6)]
    second = [kept(SECOND, index, 6 + index, DARK if index == 0 else LIT) for index in range(3)]
    reader, anyone = keep(*first, *second), grant()
    for take, index, found in (
        (FIRST, 0, first[0]),
        (FIRST, 2, name(FIRST, 4)),
        (FIRST, 3, name(FIRST, 4)),
        (FIRST, 5, first[5]),
        (FIRST, 6, name(SECOND, 1)),
        (FIRST, 7, None),
        (SECOND, 0, name(SECOND, 1)),
        (SECOND, 2, second[2]),
        (SECOND, 3, NotYet()),
        (SECOND, 4, None),
        (THIRD, 0, None),
    ):
        assert reader.find_segment(anyone, take, index, NOW_MS) == found, (take, index)
    assert reader.list_shown(anyone, NOW_MS) == [*first[:2], *first[4:], *second[1:]]
    for take, index in ((FIRST, 0), (SECOND, 3), (THIRD, 0)):
        assert reader.find_segment(grant(past_s=0.0), take, index, NOW_MS) is None


def test_what_is_dark_to_the_end_is_not_there_yet() -> None:
    reader = keep(kept(FIRST, 0, 0), kept(FIRST, 1, 1, DARK), kept(FIRST, 2, 2, DARK))
    assert reader.find_segment(grant(), FIRST, 1, NOW_MS) == NotYet()
    for index in (2, 3):  # nothing so new has been shown to them
        assert reader.find_segment(grant(), FIRST, index, NOW_MS) is None
    nothing = keep(kept(FIRST, 0, 0, DARK))
    assert nothing.find_segment(grant(), FIRST, 0, NOW_MS) is None
    assert nothing.find_segment(grant(), FIRST, 1, NOW_MS) is None
    assert nothing.list_shown(grant(), NOW_MS) == []


def test_takes_of_two_recorders_lead_on_and_never_back() -> None:
    # both hear the robot; the second one began later and ends first
    a = [kept(FIRST, index, index) for index in range(6)]
    b = [kept(SECOND, index, 2 + index) for index in range(2)]
    anyone = grant()
    order = [*a[:3], b[0], a[3], b[1]]
    reader = keep(*order)
    assert reader.find_segment(anyone, FIRST, 4, NOW_MS) == name(SECOND, 1)  # not its first one
    assert reader.find_segment(anyone, SECOND, 2, NOW_MS) == NotYet()
    assert reader.find_segment(anyone, FIRST, 3, NOW_MS) is a[3]
    reader = keep(*order, *a[4:])
    assert reader.find_segment(anyone, SECOND, 2, NOW_MS) == name(FIRST, 4)
    assert reader.find_segment(anyone, FIRST, 6, NOW_MS) == NotYet()


def test_what_is_lacking_in_a_take_is_passed_over() -> None:
    segments = [kept(FIRST, index, index) for index in (0, 1, 2, 4, 6, 7)]
    reader, anyone = keep(*segments), grant(past_s=60.0)
    assert reader.find_segment(anyone, FIRST, 3, NOW_MS) == name(FIRST, 4)
    assert reader.find_segment(anyone, FIRST, 5, NOW_MS) == name(FIRST, 6)
    assert reader.find_segment(anyone, FIRST, 0, segments[2].from_ms + 60_000) == name(FIRST, 2)


def test_what_has_left_the_window_leads_to_the_oldest() -> None:
    segments = [kept(FIRST, index, index) for index in range(5)]
    reader, anyone = keep(*segments), grant(past_s=60.0)
    now_ms = segments[2].from_ms + 60_000
    assert reader.find_segment(anyone, FIRST, 0, now_ms) == segments[2].name
    assert reader.find_segment(anyone, FIRST, 2, now_ms) is segments[2]
    assert reader.find_segment(anyone, FIRST, 2, now_ms + 1) == segments[3].name


def test_what_is_late_is_there_when_it_is_due_and_says_nothing_before() -> None:
    segments = [kept(FIRST, 0, 0), kept(FIRST, 1, 1), kept(SECOND, 0, 2)]
    reader, late = keep(*segments), grant(delay_s=10.0, past_s=60.0)
    at_ms = segments[0].to_ms + 10_000
    assert reader.find_segment(late, FIRST, 0, at_ms - 1) is None
    assert reader.list_shown(late, at_ms - 1) == []
    assert reader.find_segment(late, FIRST, 0, at_ms) is segments[0]
    assert reader.find_segment(late, FIRST, 1, at_ms) == NotYet(segments[1].to_ms + 10_000)
    assert reader.find_segment(late, FIRST, 2, at_ms) is None
    assert reader.find_segment(late, SECOND, 0, at_ms) is None
    at_ms += 4000
    assert reader.find_segment(late, FIRST, 2, at_ms) == NotYet(segments[2].to_ms + 10_000)
    assert reader.find_segment(late, FIRST, 2, at_ms + 4000) == segments[2].name


def test_a_schema_is_shown_as_long_as_a_segment_is_that_names_it() -> None:
    segments = [kept(FIRST, 0, 0), kept(FIRST, 1, 1)]
    reader, anyone = keep(*segments), grant(past_s=60.0)
    assert reader.find_schema(anyone, SCHEMA_HASH, NOW_MS) is segments[1]
    assert reader.find_schema(anyone, bytes(32), NOW_MS) is None
    assert reader.find_schema(anyone, SCHEMA_HASH, segments[1].from_ms + 60_001) is None
    assert keep(kept(FIRST, 0, 0, DARK)).find_schema(anyone, SCHEMA_HASH, NOW_MS) is None
