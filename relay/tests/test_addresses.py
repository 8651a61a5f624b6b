"""Whose connection it is, whatever a header says."""

from __future__ import annotations

import asyncio
from typing import Any

import httpx
import pytest
import websockets
from posecast_relay.auth.addresses import Addresses, find_real_address, is_loopback, may_show, parse_networks

TRUSTED = parse_networks("10.0.0.0/8, 127.0.0.1, fd00::/8")


def test_this_machine_has_several_addresses() -> None:
    own = ("127.0.0.1", "127.8.8.8", "::1", "::ffff:127.0.0.1")
    other = ("10.0.0.1", "::ffff:10.0.0.1", "172.17.0.1", "fe80::1%eth0", "", "localhost")
    assert [is_loopback(peer) for peer in own + other] == [True] * len(own) + [False] * len(other)


@pytest.mark.parametrize(
    ("peer", "forwarded", "address"),
    [
        ("203.0.113.9", None, "203.0.113.9"),
        ("203.0.113.9", "1.2.3.4", "203.0.113.9"),  # no proxy of ours: anybody may send the header
        ("10.1.1.1", "1.2.3.4", "1.2.3.4"),
        ("10.1.1.1", "6.6.6.6, 1.2.3.4", "1.2.3.4"),  # what stands further left is the sender's own word
        ("10.1.1.1", "1.2.3.4, 10.2.2.2", "1.2.3.4"),
        ("::ffff:10.1.1.1", "1.2.3.4", "1.2.3.4"),
        ("10.1.1.1", "", "10.1.1.1"),
        ("10.1.1.1", "nonsense", "10.1.1.1"),
        ("10.1.1.1", "1.2.3.4, nonsense", "10.1.1.1"),
        ("10.1.1.1", "10.2.2.2, 10.3.3.3", "10.2.2.2"),
        ("fd00::1", "2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("2001:db8:1:2::1", None, "2001:db8:1:2::/64"),
        ("fe80::1%eth0", None, "fe80::/64"),
        ("10.1.1.1", "x, " * 100_000 + "1.2.3.4", "1.2.3.4"),
        ("unix", None, "unix"),
    ],
)
def test_the_real_address(peer: str, forwarded: str | None, address: str) -> None:
    assert find_real_address(peer, forwarded, TRUSTED) == address


def test_without_trusted_proxies_the_header_counts_for_nothing() -> None:
    assert find_real_address("10.1.1.1", "1.2.3.4", ()) == "10.1.1.1"


def test_each_address_has_its_share_and_gets_it_back() -> None:
    addresses = Addresses(2)
    assert [addresses.enter("1.1.1.1", None) for _ in range(3)] == ["1.1.1.1", "1.1.1.1", None]
    assert addresses.enter("2.2.2.2", None) == "2.2.2.2"
    addresses.leave("1.1.1.1")
    assert addresses.enter("1.1.1.1", None) == "1.1.1.1"
    for address in ("1.1.1.1", "1.1.1.1", "2.2.2.2"):
        addresses.leave(address)
    assert len(addresses) == 0


def test_this_machine_itself_is_not_counted() -> None:
    addresses = Addresses(1)
    for peer in ("127.0.0.1", "127.9.9.9", "::1", "::ffff:127.0.0.1"):
        assert addresses.enter(peer, None) == addresses.enter(peer, None) == ""
        addresses.leave("")
    assert len(addresses) == 0


async def test_streams_of_one_address_are_capped_behind_a_proxy_and_without(relays: Any) -> None:
    # with a past they would be let in to be told the lane
    relay = relays("--max-per-address", "1", "--trusted-proxies", "127.0.0.1", "--past", "0")

    def of(address: str) -> Any:
        headers = {"X-Forwarded-For": f"6.6.6.6, {address}"}
        return websockets.connect(relay.url(), additional_headers=headers, proxy=None)

    async with of("1.1.1.1") as first:
        await first.recv()
        with pytest.raises(websockets.InvalidStatus) as refused:
            await of("1.1.1.1")
        assert refused.value.response.status_code == 503
        assert refused.value.response.headers["Retry-After"] == "30"
        url = f"http://{relay.address}/api/v1/robots/r/live.sse"
        events = await asyncio.to_thread(httpx.get, url, headers={"X-Forwarded-For": "1.1.1.1"})
        assert events.status_code == 503
        async with of("2.2.2.2") as other:
            await other.recv()

    async def again() -> bool:
        try:
            async with of("1.1.1.1") as back:
                await back.recv()
                return True
        except websockets.InvalidStatus:
            return False

    async with asyncio.timeout(10):
        while not await again():  # the relay hears of the end a moment later
            await asyncio.sleep(0.02)


# ---- which pages may show what is not for everybody ----------------------------------


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
