"""The one function that says who may see what."""

from __future__ import annotations

import pytest
from posecast_relay.core.policy import Audience, Grant, Policy, Principal, Rule, make_link, read_link
from posecast_wire import Close

A, S, L = Audience.ANYONE, Audience.SIGNED_IN, Audience.LINK
POLICY = Policy(
    {
        "open": {A: Rule(hz=5.0, delay_s=10.0, viewers=3)},
        "both": {A: Rule(), S: Rule("lab"), L: Rule("guests")},
        "lab": {S: Rule("lab")},
        "shared": {L: Rule("guests")},
        "dark": {A: Rule(blackout=True), S: Rule("lab", blackout=True)},
        "half-dark": {A: Rule(), S: Rule("lab", blackout=True)},
        "unseen": {},
        "framed": {A: Rule(frames=("https://course.example",))},
        "unframed": {A: Rule(frames=())},
    }
)
NOBODY, SOMEBODY = Principal(), Principal(S)


def link(robot: str) -> Principal:
    """Who has a share link."""
    return Principal(L, robot)


@pytest.mark.parametrize(
    ("who", "robot", "view", "gets"),
    [
        (NOBODY, "open", None, "public"),
        (NOBODY, "open", "public", "public"),
        (NOBODY, "open", "lab", Close.FORBIDDEN),
        (SOMEBODY, "open", None, "public"),
        (NOBODY, "both", None, "public"),
        (NOBODY, "both", "lab", Close.FORBIDDEN),
        (NOBODY, "both", "guests", Close.FORBIDDEN),
        (SOMEBODY, "both", None, "lab"),
        (SOMEBODY, "both", "public", "public"),
        (SOMEBODY, "both", "guests", Close.FORBIDDEN),
        (link("both"), "both", None, "guests"),
        (link("both"), "both", "public", "public"),
        (link("open"), "both", None, "public"),
        (link("open"), "both", "guests", Close.FORBIDDEN),
        (NOBODY, "lab", None, Close.ABSENT),
        (NOBODY, "lab", "lab", Close.ABSENT),
        (link("lab"), "lab", None, Close.ABSENT),
        (SOMEBODY, "lab", None, "lab"),
        (NOBODY, "shared", "guests", Close.ABSENT),
        (link("open"), "shared", None, Close.ABSENT),
        (link("shared"), "shared", None, "guests"),
        (SOMEBODY, "dark", None, Close.ABSENT),
        (SOMEBODY, "half-dark", None, "public"),
        (SOMEBODY, "half-dark", "lab", Close.FORBIDDEN),
        (SOMEBODY, "unseen", None, Close.ABSENT),
        (SOMEBODY, "no-such", None, Close.ABSENT),
        (SOMEBODY, "__proto__", None, Close.ABSENT),
    ],
)
def test_who_gets_what(who: Principal, robot: str, view: str | None, gets: object) -> None:
    found = POLICY.judge(who, robot, view)
    assert (found.view if isinstance(found, Grant) else found) == gets


def test_a_grant_carries_its_rule() -> None:
    found = POLICY.judge(SOMEBODY, "open")
    assert isinstance(found, Grant)
    assert (found.hz, found.delay_s, found.viewers, found.by, found.open) == (5.0, 10.0, 3, A, True)
    private = POLICY.judge(SOMEBODY, "lab")
    assert isinstance(private, Grant)
    assert not private.open
    assert POLICY.find_delays_s() == {("open", "public"): 10.0}


def test_without_a_file_every_public_view_is_open_and_no_other() -> None:
    for robot in ("any", "other"):
        found = Policy().judge(NOBODY, robot)
        assert isinstance(found, Grant)
        assert (found.view, found.hz, found.delay_s, found.viewers) == ("public", 60.0, 0.0, None)
    assert Policy().judge(SOMEBODY, "any", "lab") == Close.FORBIDDEN


@pytest.mark.parametrize(
    ("robot", "pages"),
    [
        ("open", ("*",)),
        ("both", ("*",)),
        ("framed", ("'self'", "https://course.example")),
        ("unframed", ("'self'",)),
        # one answer for what is hidden, what is not there, and an address that names none
        *((name, ("'self'", "https://listed.example")) for name in ("lab", "shared", "dark", "none", "")),
    ],
)
def test_which_pages_may_frame_it(robot: str, pages: tuple[str, ...]) -> None:
    assert POLICY.list_frame_ancestors(robot, ["https://listed.example"]) == pages


def test_without_a_file_any_page_may_frame_any_robot() -> None:
    assert Policy().list_frame_ancestors("", ["https://listed.example"]) == ("*",)


# ---- share links: what is signed, and what is not good -------------------------------


KEY, OTHER = "k" * 43, "o" * 43
KEYS = {"hubo": KEY, "g1": OTHER}
GOOD = make_link(KEY, "hubo", 2000, "AbCd_-09")


def test_whoever_has_it_sees_one_robot_until_it_expires() -> None:
    assert read_link(GOOD, KEYS, 1999.9) == Principal(Audience.LINK, "hubo", 2000.0, GOOD)
    assert read_link(GOOD, KEYS, 2000.0) is None
    assert GOOD not in repr(read_link(GOOD, KEYS, 0.0))


@pytest.mark.parametrize(
    "token",
    [
        "",
        "L1.",
        GOOD[:-1],
        GOOD + "A",
        GOOD + "\n",
        " " + GOOD,
        GOOD.replace("hubo", "g1"),
        GOOD.replace("2000", "9000"),
        GOOD.replace("AbCd", "AbCe"),
        GOOD[:-1] + ("A" if GOOD[-1] != "A" else "B"),
        make_link(OTHER, "hubo", 2000, "AbCd_-09"),
        make_link("no such robot", "absent", 2000, "AbCd_-09"),
        make_link(KEY, "absent", 2000, "AbCd_-09"),
        make_link(KEY, "hubo", 2000, "AbCd").replace("2000", "02000"),
        make_link(KEY, "hubo", 10**12, "AbCd_-09"),
        GOOD.replace("L1", "L2"),
        GOOD.replace("L1.hubo", "L1.hubo.x"),
        "ü" * 100,
    ],
)
def test_nothing_else_is_good(token: str) -> None:
    assert read_link(token, KEYS, 0.0) is None


def test_another_key_ends_all_links() -> None:
    assert read_link(GOOD, {"hubo": OTHER}, 0.0) is None
