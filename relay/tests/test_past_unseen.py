"""What was taken back before somebody could see it live, told from how the rules changed."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from posecast_relay.core.policy import Audience, Grant, Policy, Principal, Rule
from posecast_relay.past import reading
from posecast_relay.past.reading import HiddenSpans

A, S = Audience.ANYONE, Audience.SIGNED_IN
LATE = Rule(delay_s=10.0, past_s=600.0)
NOW_MS = 1_800_000_000_000


@dataclass(frozen=True)
class Stretch:
    """Four seconds that ended `ago_ms` before the rules changed."""

    ago_ms: int
    audiences: frozenset[Audience] = frozenset(Audience)

    @property
    def from_ms(self) -> int:
        return self.to_ms - 4000

    @property
    def to_ms(self) -> int:
        return NOW_MS - self.ago_ms


def grant(rule: Rule = LATE) -> Grant:
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
    assert not found.has(grant(), Stretch(10_000))  # was due
    assert found.has(grant(), Stretch(9_999))
    assert found.has(grant(), Stretch(0))
    assert not found.has(grant(), Stretch(-4001))  # began after it


def test_what_goes_on_takes_nothing_back() -> None:
    lit = Policy({"r": {A: LATE, S: Rule()}})
    hidden = Policy({"r": {A: Rule(delay_s=10.0, past_s=0.0), S: Rule(blackout=True)}})
    found = change(lit, hidden, lit, Policy({"r": {A: Rule(delay_s=5.0, past_s=60.0), S: Rule()}}))
    assert not found.has(grant(), Stretch(0))


def test_a_robot_that_was_removed_has_no_past() -> None:
    open_ = Policy({"r": {A: Rule()}})
    found = change(open_, Policy({}), open_)
    assert found.has(grant(Rule()), Stretch(3_600_000))
    assert not found.has(grant(Rule()), Stretch(-4000))
    assert not change(open_, open_).has(grant(Rule()), Stretch(0))


def test_what_was_before_the_process_is_not_for_who_sees_late() -> None:
    before = Stretch(86_400_000)
    policy = Policy({"r": {A: LATE}})
    assert change(policy, knows_all=False).has(grant(), before)
    assert not change(policy, knows_all=True).has(grant(), before)
    assert not change(policy, knows_all=False).has(grant(Rule()), before)


def test_what_is_remembered_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "SPANS_MAX", 2)
    lit, dark = Policy({"r": {A: LATE}}), Policy({"r": {A: Rule(blackout=True)}})
    found = HiddenSpans(knows_all=True)
    for hour in range(4):
        found.set_policy(lit, NOW_MS + 3_600_000 * hour)
        found.set_policy(dark, NOW_MS + 3_600_000 * hour + 60_000)
    assert found.has(grant(), Stretch(-1_800_000))  # between two that have become one
    assert not found.has(grant(), Stretch(-9_000_000))
