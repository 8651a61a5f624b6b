"""The one function that says who is let in, whichever way they come, and what they are told if not."""

from __future__ import annotations

from dataclasses import replace
from http import HTTPStatus
from itertools import product

import pytest
from posecast_relay.core.policy import (
    ANYONE,
    CROWDED,
    DRAINING,
    FOREIGN,
    FULL,
    REFUSALS,
    ROBOT_FULL,
    Applicant,
    Audience,
    Grant,
    Occupancy,
    Policy,
    Principal,
    Refusal,
    Rule,
    admit,
    find_no_room,
)
from posecast_relay.runtime.tasks import FAULT
from posecast_wire import Close, Retry, retry_of

A, S, L = Audience.ANYONE, Audience.SIGNED_IN, Audience.LINK
POLICY = Policy(
    {"open": {A: Rule(viewers=2), L: Rule("lab")}, "lab": {S: Rule("lab")}, "shared": {L: Rule()}}
)
SOMEBODY = Principal(S, token="t")
ASKS = Applicant("open", who=ANYONE)


def admitted(applicant: Applicant, policy: Policy = POLICY) -> Grant:
    """What they got."""
    found = admit(applicant, policy)
    assert isinstance(found, Grant), found
    return found


def test_anyone_gets_what_is_open() -> None:
    grant = admitted(ASKS)
    assert (grant.robot, grant.view, grant.by, grant.who) == ("open", "public", A, ANYONE)
    assert admitted(Applicant("whichever", who=ANYONE), Policy()).view == "public"


@pytest.mark.parametrize(
    ("applicant", "close", "status", "reason", "retry_s"),
    [
        (Applicant("lab", who=ANYONE), Close.ABSENT, 404, "no such robot, or you may not see it", None),
        (Applicant("none", who=SOMEBODY), Close.ABSENT, 404, "no such robot, or you may not see it", None),
        (Applicant("open", "lab", who=ANYONE), Close.FORBIDDEN, 403, "you may not see this view", None),
        (
            Applicant("open", shows_token=True, who=Close.TOKEN),
            *(Close.TOKEN, 401, "the link or sign-in is invalid or has expired", None),
        ),
        (
            Applicant("open", shows_token=True, who=Close.FULL),
            *(Close.FULL, 503, "your sign-in can't be checked right now", 30.0),
        ),
        (
            replace(ASKS, shows_token=True, is_foreign=True),
            Close.FORBIDDEN,
            403,
            "pages of this origin may not use it",
            None,
        ),
        (replace(ASKS, is_crowded=True), Close.FULL, 503, "too many streams from this address", 30.0),
        (replace(ASKS, bad_name="a name"), Close.ABSENT, 404, "a name", None),
        (replace(ASKS, who=Close.INTERNAL_ERROR), Close.INTERNAL_ERROR, 500, FAULT, None),
    ],
)
def test_a_refusal_says_the_same_whichever_way_they_come(
    applicant: Applicant, close: Close, status: int, reason: str, retry_s: float | None
) -> None:
    found = admit(applicant, POLICY)
    assert isinstance(found, Refusal)
    assert (found.close, found.status, found.reason, found.retry_s) == (close, status, reason, retry_s)
    assert found.at_door == (found in (FOREIGN, CROWDED))


def test_what_is_not_for_them_is_as_what_is_not() -> None:
    assert admit(Applicant("shared", who=ANYONE), POLICY) is admit(Applicant("absent", who=ANYONE), POLICY)


def test_a_foreign_page_may_ask_for_what_is_open_and_shows_no_token() -> None:
    assert admitted(replace(ASKS, is_foreign=True)) == admitted(ASKS)
    assert admitted(replace(ASKS, shows_token=True)) == admitted(ASKS)


def test_before_it_is_known_who_asks_only_what_stands_in_the_request_speaks_against_them() -> None:
    nobody = Applicant("lab", shows_token=True)
    assert admit(nobody, POLICY) is None
    assert admit(replace(nobody, is_foreign=True), POLICY) is FOREIGN
    assert admit(replace(nobody, is_crowded=True), POLICY) is CROWDED
    assert isinstance(admit(replace(nobody, bad_name="no name"), POLICY), Refusal)


def test_whoever_asks_for_no_robot_alone_is_only_asked_who_they_are() -> None:
    assert admit(Applicant(shows_token=True, who=SOMEBODY), POLICY) is None
    assert admit(Applicant(shows_token=True, who=Close.TOKEN), POLICY) is REFUSALS[Close.TOKEN]


def test_the_first_thing_that_is_wrong_is_what_they_are_told() -> None:
    """In each combination; so no way in can tell another one first."""
    whos: tuple[Principal | Close, ...] = (Close.TOKEN, ANYONE)
    for foreign, crowded, bad, who in product((True, False), (True, False), ("no name", None), whos):
        found = admit(Applicant("lab", None, True, foreign, crowded, bad, who), POLICY)
        assert isinstance(found, Refusal)
        last = REFUSALS[Close.TOKEN if who is Close.TOKEN else Close.ABSENT]
        named = Refusal(Close.ABSENT, HTTPStatus.NOT_FOUND, "no name")
        assert found == (FOREIGN if foreign else CROWDED if crowded else named if bad else last)


def test_whoever_is_refused_for_want_of_room_is_told_when_to_come_again() -> None:
    refusals = (*REFUSALS.values(), FOREIGN, CROWDED, DRAINING, FULL, ROBOT_FULL)
    for refusal in refusals:
        told = refusal.retry_s is not None
        assert told == (retry_of(refusal.close) in (Retry.WAIT, Retry.SPREAD)), refusal
        assert told == (refusal.status is HTTPStatus.SERVICE_UNAVAILABLE)


@pytest.mark.parametrize(
    ("occupancy", "refusal"),
    [
        (Occupancy(0, 10), None),
        (Occupancy(9, 10, 1), None),
        (Occupancy(10, 10, 1), FULL),
        (Occupancy(11, 10, 2), FULL),
        (Occupancy(9, 10, 2), ROBOT_FULL),
        (Occupancy(10, 10, 2, is_draining=True), DRAINING),
        (Occupancy(0, 10, is_draining=True), DRAINING),
    ],
)
def test_there_is_room_or_not(occupancy: Occupancy, refusal: Refusal | None) -> None:
    assert find_no_room(admitted(ASKS), occupancy) is refusal


def test_a_grant_without_a_cap_has_room_until_the_relay_is_full() -> None:
    grant = admitted(Applicant("lab", who=SOMEBODY))
    assert find_no_room(grant, Occupancy(9, 10, 9)) is None
    assert find_no_room(None, Occupancy(9, 10, 9)) is None
    assert find_no_room(None, Occupancy(10, 10)) is FULL
