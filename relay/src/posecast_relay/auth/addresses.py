"""Where a viewer comes from: its real address, how many streams that address has, and which pages may show
views that are not public. A lecture hall may share one address. The relay uses no cookies.
"""

from __future__ import annotations

import ipaddress
import re
from collections import Counter
from collections.abc import Collection, Sequence

Address = ipaddress.IPv4Address | ipaddress.IPv6Address
Network = ipaddress.IPv4Network | ipaddress.IPv6Network
FORWARDED_MAX = 4000  # last characters of the header that are read; proxies append their part at the end
OWN_V6 = "::/64"
PREFIX_V6 = 64  # one household or server usually has a whole /64


def parse_networks(text: str) -> tuple[Network, ...]:
    """Parse networks like `10.0.0.0/8, 127.0.0.1`. Raises ValueError."""
    return tuple(ipaddress.ip_network(part.strip(), strict=False) for part in text.split(",") if part.strip())


def find_asker(peer: str, forwarded: str | None, trusted: Sequence[Network]) -> Address | None:
    """Return the last address in `X-Forwarded-For` that is not a trusted proxy. Without one, return the
    peer's address, which is None if it is unknown. `forwarded`: all headers of that name, joined by commas.

    Without trusted proxies the header does not affect the result, because anybody can send it.
    """
    found = _parse_address(peer)
    hops = (forwarded or "")[-FORWARDED_MAX:].split(",") if trusted else []
    while found is not None and hops and any(found in network for network in trusted):
        nearer = _parse_address(hops.pop().strip())
        if nearer is None:
            break
        found = nearer
    return found


def find_real_address(peer: str, forwarded: str | None, trusted: Sequence[Network]) -> str:
    """Return the address under which a viewer is counted (see find_asker); for IPv6, its /64 prefix."""
    found = find_asker(peer, forwarded, trusted)
    if found is None:
        return peer
    if found.version == 6:
        return str(ipaddress.ip_network((found, PREFIX_V6), strict=False))
    return str(found)


def is_loopback(peer: str) -> bool:
    """Whether a connection comes from this machine."""
    found = _parse_address(peer)
    return found is not None and found.is_loopback


def _parse_address(text: str) -> Address | None:
    try:
        found = ipaddress.ip_address(text.partition("%")[0])
    except ValueError:
        return None
    mapped = found.ipv4_mapped if isinstance(found, ipaddress.IPv6Address) else None
    return mapped or found


class Addresses:
    """Counts streams by address, and allows at most `most` streams for each."""

    def __init__(self, most: int, trusted: Sequence[Network] = ()) -> None:
        self.most = most
        self.trusted = trusted
        self._open: Counter[str] = Counter()

    def enter(self, peer: str, forwarded: str | None) -> str | None:
        """Count a stream and return the name to pass to `leave`; None if its address is at the limit.

        This machine has no limit, because all viewers may come through a local proxy that was not configured.
        """
        address = find_real_address(peer, forwarded, self.trusted)
        if address.startswith("127.") or address == OWN_V6:
            return ""
        if self._open[address] >= self.most:
            return None
        self._open[address] += 1
        return address

    def leave(self, address: str) -> None:
        """Stop counting one stream that `enter` counted."""
        if not address:
            return
        self._open[address] -= 1
        if self._open[address] <= 0:
            del self._open[address]

    def __len__(self) -> int:
        """How many addresses have streams."""
        return len(self._open)


# what a browser sends as `Origin`, without characters that could end a header or a list in it
ORIGIN = re.compile(r"https?://(\[[0-9a-f:]+\]|[A-Za-z0-9._-]+)(:\d{1,5})?")


def may_show(origin: str | None, host: str | None, listed: Collection[str]) -> bool:
    """Whether a page of this `Origin` may show views that are not public.

    None means that the client is not a browser, so its token decides.

    Two kinds of pages may: the relay's own, whose `Origin` matches the request's `host`, and those in
    `listed`. The comparison is exact: `https://good.example.evil.example` and `null` don't match.
    """
    if origin is None:
        return True
    if origin in listed:
        return True
    return ORIGIN.fullmatch(origin) is not None and origin.partition("://")[2] == host
