"""Which pages may show what is not for everybody."""

from __future__ import annotations

import pytest
from posecast_relay.auth.addresses import may_show

LISTED = ("https://good.com", "https://lab.example:8443")


@pytest.mark.parametrize(
    ("origin", "may"),
    [
        (None, True),  # no browser
        ("https://good.com", True),
        ("https://lab.example:8443", True),
        ("https://relay.example", True),  # the very host that is asked
        ("http://relay.example", True),
        ("https://good.com.evil.com", False),
        ("https://evilgood.com", False),
        ("https://evil.com", False),
        ("http://good.com", False),
        ("https://good.com:444", False),
        ("https://lab.example", False),
        ("https://relay.example.evil.com", False),
        ("https://relay.example:8443", False),
        ("https://relay.example@evil.com", False),
        ("https://evil.com@relay.example", False),
        ("https://relay.example/x", False),
        ("ftp://relay.example", False),
        ("null", False),
        ("", False),
        ("https://[", False),
        (" https://relay.example", False),
        ("https://relay.example ", False),
        ("*", False),
    ],
)
def test_an_origin(origin: str | None, may: bool) -> None:
    assert may_show(origin, "relay.example", LISTED) is may


def test_without_a_host_nothing_is_the_same_host() -> None:
    assert not may_show("https://", "", ())
    assert not may_show("https://", None, ())
