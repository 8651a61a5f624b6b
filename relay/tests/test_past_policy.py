"""Who may look back on what, by the rules of today and those of the time when it was recorded."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest
from posecast_relay.core.policy import (
    PAST_S,
    Applicant,
    Audience,
    Grant,
    PastWindow,
    Policy,
    Principal,
    Rule,
    admit,
    compute_kept_longest_s,
    compute_kept_s,
    find_past_window,
    is_past_shown,
    list_lookers,
)
from posecast_relay.past import reading
from posecast_relay.past.reading import HiddenSpans

A, S, L = Audience.ANYONE, Audience.SIGNED_IN, Audience.LINK
NOBODY, SOMEBODY, GUEST = Principal(), Principal(S), Principal(L, "r")
NOW_MS = 1_800_000_000_000
MINUTE_MS = 60_000


@dataclass(frozen=True)
class Stretch:
    """Something recorded."""

    from_ms: int
    to_ms: int
    audiences: frozenset[Audience]


def grant(rule: Rule, audience: Audience = A, view: str | None = None) -> Grant:
    """What an audience gets by a rule."""
    who = {A: NOBODY, S: SOMEBODY, L: GUEST}[audience]
    found = admit(Applicant("r", view, who=who), Policy({"r": {audience: rule}}))
    assert isinstance(found, Grant)
    return found


def may_look(
    granted: Grant, ago_ms: int, length_ms: int = 4000, audiences: frozenset[Audience] = frozenset(Audience)
) -> bool:
    """Whether they get a segment that ended so long ago."""
    to_ms = NOW_MS - ago_ms
    return is_past_shown(
        granted, Stretch(to_ms - length_ms, to_ms, audiences), find_past_window(granted, NOW_MS)
    )


@pytest.mark.parametrize(
    ("rule", "audience", "past_s"),
    [
        (Rule(), A, PAST_S),
        (Rule("lab"), S, PAST_S),
        (Rule(), L, 0.0),
        (Rule(past_s=60.0), L, 60.0),
        (Rule(delay_s=5.0), A, 0.0),
        (Rule(delay_s=5.0, past_s=60.0), A, 60.0),
        (Rule(past_s=0.0), A, 0.0),
        (Rule(hz=59.0), A, 0.0),
        (Rule(hz=10.0, past_s=600.0), A, 0.0),  # the file is refused, but by no other way either
    ],
)
def test_how_far_back_an_audience_may_look(rule: Rule, audience: Audience, past_s: float) -> None:
    granted = grant(rule, audience)
    assert granted.past_s == past_s
    assert may_look(granted, round(1000 * rule.delay_s)) == (past_s > 0)


def test_the_window_is_kept_to_the_millisecond_and_in_delayed_time() -> None:
    live = grant(Rule(past_s=60.0))
    late = grant(Rule(past_s=60.0, delay_s=10.0))
    for granted, delay_ms in ((live, 0), (late, 10_000)):
        assert may_look(granted, delay_ms)
        assert not may_look(granted, delay_ms - 1)
        assert may_look(granted, delay_ms + MINUTE_MS - 4000)
        assert not may_look(granted, delay_ms + MINUTE_MS - 3999)
    window = find_past_window(late, NOW_MS)
    assert window == PastWindow(NOW_MS - 70_000, NOW_MS - 10_000)
    assert window.compute_left_s(NOW_MS - 70_000) == 0.0
    assert window.compute_left_s(NOW_MS - 10_000) == 60.0
    assert window.compute_left_s(0) == 0.0
    assert find_past_window(grant(Rule(past_s=0.0)), NOW_MS).compute_left_s(NOW_MS) == 0.0


def test_both_the_rules_of_then_and_those_of_today_must_allow_it() -> None:
    for then in (frozenset[Audience](), frozenset({A}), frozenset({S, L}), frozenset(Audience)):
        for audience in Audience:
            granted = grant(Rule(past_s=600.0), audience)
            assert may_look(granted, 1000, audiences=then) == (audience in then)


def test_who_may_look_back_on_what_is_live_now() -> None:
    policy = Policy(
        {
            "r": {A: Rule(), S: Rule("lab"), L: Rule("lab", past_s=1.0)},
            "slow": {A: Rule(hz=30.0), S: Rule(delay_s=60.0, past_s=1.0)},
            "dark": {A: Rule(blackout=True), S: Rule(viewers=0), L: Rule(viewers=1, past_s=1.0)},
            "undecided": {A: Rule(past_s=0.0), S: Rule(delay_s=1.0), L: Rule()},
            "unseen": {},
        }
    )
    assert list_lookers(policy, "r", "public") == {A}
    assert list_lookers(policy, "r", "lab") == {S, L}
    assert list_lookers(policy, "r", "guests") == frozenset()
    assert list_lookers(policy, "slow", "public") == {S}
    assert list_lookers(policy, "dark", "public") == {L}
    assert list_lookers(policy, "undecided", "public") == frozenset()
    assert list_lookers(policy, "unseen", "public") == list_lookers(policy, "none", "public") == frozenset()
    assert list_lookers(Policy(), "any", "public") == {A}
    assert list_lookers(Policy(), "any", "lab") == frozenset()


def test_for_how_long_it_is_worth_keeping() -> None:
    rules = {A: Rule(past_s=0.0), S: Rule(delay_s=20.0, past_s=60.0), L: Rule("lab", past_s=3600.0)}
    policy = Policy({"r": rules, "hidden": {}, "dark": {A: Rule(blackout=True, past_s=7200.0)}})
    assert compute_kept_s(policy, "r", "public") == 80.0
    assert compute_kept_s(policy, "r", "lab") == 3600.0
    assert compute_kept_s(policy, "r", "guests") == 0.0
    assert compute_kept_s(policy, "hidden", "public") == compute_kept_s(policy, "none", "public") == 0.0
    assert compute_kept_s(policy, "dark", "public") == 7200.0  # a blackout ends
    assert compute_kept_longest_s(policy) == 7200.0
    assert compute_kept_longest_s(Policy()) == compute_kept_s(Policy(), "any", "public") == PAST_S
    assert compute_kept_longest_s(Policy({})) == 0.0


def test_a_blackout_closes_the_past_and_leaves_a_hole_when_it_ends() -> None:
    before = Policy({"r": {A: Rule()}})
    dark = Policy({"r": {A: Rule(blackout=True)}})
    stretches = {
        name: list_lookers(rules, "r", "public") for name, rules in (("lit", before), ("dark", dark))
    }
    assert not isinstance(admit(Applicant("r", who=NOBODY), dark), Grant)
    granted = admit(Applicant("r", who=NOBODY), before)
    assert isinstance(granted, Grant)
    assert may_look(granted, 0, audiences=stretches["lit"])
    assert not may_look(granted, 0, audiences=stretches["dark"])
    assert not may_look(replace(granted, by=L), 0, audiences=stretches["lit"])


LATE = Rule(delay_s=10.0, past_s=600.0)


@dataclass(frozen=True)
class Recent:
    """Four seconds that ended `ago_ms` before the rules changed."""

    ago_ms: int
    audiences: frozenset[Audience] = frozenset(Audience)

    @property
    def from_ms(self) -> int:
        return self.to_ms - 4000

    @property
    def to_ms(self) -> int:
        return NOW_MS - self.ago_ms


def grant_late(rule: Rule = LATE) -> Grant:
    found = Policy({"r": {A: rule}}).judge(Principal(), "r")
    assert isinstance(found, Grant)
    return found


def change(*policies: Policy, knows_all: bool = True) -> HiddenSpans:
    """The first one came a day before, all others now."""
    found = HiddenSpans(knows_all)
    found.set_policy(policies[0], NOW_MS - 86_400_000)
    for policy in policies[1:]:
        found.set_policy(policy, NOW_MS)
    return found


@pytest.mark.parametrize(
    "after",
    [
        {A: Rule(delay_s=10.0, past_s=600.0, blackout=True)},
        {A: Rule(delay_s=10.0, past_s=600.0, viewers=0)},
        {A: Rule(delay_s=10.0, hz=10.0)},
        {A: Rule("lab", delay_s=10.0, past_s=600.0)},
        {A: Rule(past_s=600.0)},  # at once: what is on its way is shown to nobody
        {S: LATE},
        {},
    ],
)
def test_what_is_on_its_way_when_it_ends_is_not_seen(after: dict[Audience, Rule]) -> None:
    lit = Policy({"r": {A: LATE}})
    found = change(lit, Policy({"r": after}), lit)
    assert not found.has(grant_late(), Recent(10_000))  # was due
    assert found.has(grant_late(), Recent(9_999))
    assert found.has(grant_late(), Recent(0))
    assert not found.has(grant_late(), Recent(-4001))  # began after it


def test_what_goes_on_takes_nothing_back() -> None:
    lit = Policy({"r": {A: LATE, S: Rule()}})
    hidden = Policy({"r": {A: Rule(delay_s=10.0, past_s=0.0), S: Rule(blackout=True)}})
    found = change(lit, hidden, lit, Policy({"r": {A: Rule(delay_s=5.0, past_s=60.0), S: Rule()}}))
    assert not found.has(grant_late(), Recent(0))


def test_a_robot_that_was_removed_has_no_past() -> None:
    open_ = Policy({"r": {A: Rule()}})
    found = change(open_, Policy({}), open_)
    assert found.has(grant_late(Rule()), Recent(3_600_000))
    assert not found.has(grant_late(Rule()), Recent(-4000))
    assert not change(open_, open_).has(grant_late(Rule()), Recent(0))


def test_what_was_before_the_process_is_not_for_who_sees_late() -> None:
    before = Recent(86_400_000)
    policy = Policy({"r": {A: LATE}})
    assert change(policy, knows_all=False).has(grant_late(), before)
    assert not change(policy, knows_all=True).has(grant_late(), before)
    assert not change(policy, knows_all=False).has(grant_late(Rule()), before)


def test_what_is_remembered_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "SPANS_MAX", 2)
    lit, dark = Policy({"r": {A: LATE}}), Policy({"r": {A: Rule(blackout=True)}})
    found = HiddenSpans(knows_all=True)
    for hour in range(4):
        found.set_policy(lit, NOW_MS + 3_600_000 * hour)
        found.set_policy(dark, NOW_MS + 3_600_000 * hour + 60_000)
    assert found.has(grant_late(), Recent(-1_800_000))  # between two that have become one
    assert not found.has(grant_late(), Recent(-9_000_000))
