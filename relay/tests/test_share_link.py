"""Share links: what is signed, and what is not good."""

from __future__ import annotations

import pytest
from posecast_relay.core.policy import Audience, Principal, make_link, read_link

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
