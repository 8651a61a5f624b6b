"""Finds a connection's real address and counts the streams of each. A lecture hall may share one address."""

from __future__ import annotations

import ipaddress
from collections import Counter
from collections.abc import Sequence

from posecast_relay.core.roster import CountsElsewhere

Address = ipaddress.IPv4Address | ipaddress.IPv6Address
Network = ipaddress.IPv4Network | ipaddress.IPv6Network
FORWARDED_MAX = 4000  # letters of the header; what stands further left anybody may have written
OWN_V6 = "::/64"
PREFIX_V6 = 64  # one household, one server: as good as one address


def parse_networks(text: str) -> tuple[Network, ...]:
    """Parse networks like `10.0.0.0/8, 127.0.0.1`. Raises ValueError."""
    return tuple(ipaddress.ip_network(part.strip(), strict=False) for part in text.split(",") if part.strip())


def find_asker(peer: str, forwarded: str | None, trusted: Sequence[Network]) -> Address | None:
    """Return the last address of `X-Forwarded-For` that is no trusted proxy's; else the peer's own, which is
    None on a Unix socket. `forwarded`: all headers of that name, with commas between.

    Without trusted proxies the header counts for nothing, since anybody may send it.
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
    """Return by what an asker is counted: see find_asker. Of IPv6 the prefix, which one household shares."""
    found = find_asker(peer, forwarded, trusted)
    if found is None:
        return peer
    if found.version == 6:
        return str(ipaddress.ip_network((found, PREFIX_V6), strict=False))
    return str(found)


def is_loopback(peer: str) -> bool:
    """Whether a connection's address is that of the machine it was made on."""
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
    """Counts streams by address, and allows at most `most` of each.

    Previews are counted apart, since they take no viewer's place.
    """

    def __init__(
        self, most: int, trusted: Sequence[Network] = (), elsewhere: CountsElsewhere | None = None
    ) -> None:
        """`elsewhere`: what other processes of this relay count, if there are any."""
        self.most = most
        self.trusted = trusted
        self._elsewhere = elsewhere
        self._open: Counter[str] = Counter()

    def enter(self, peer: str, forwarded: str | None, is_preview: bool = False) -> str | None:
        """Count a stream and return what to `leave` with; None when its address has as many as it may.

        This machine itself has no limit: all viewers may come through a proxy here that was not configured.
        """
        address = find_real_address(peer, forwarded, self.trusted)
        if address.startswith("127.") or address == OWN_V6:
            return ""
        if is_preview:
            address += " (previews)"
        others = 0 if self._elsewhere is None else self._elsewhere.count_elsewhere(f"address {address}")
        if self._open[address] + others >= self.most:
            return None
        self._open[address] += 1
        if self._elsewhere is not None:
            self._elsewhere.add(f"address {address}", 1)
        return address

    def leave(self, address: str) -> None:
        """Take off one stream of those that `enter` counted."""
        if not address:
            return
        self._open[address] -= 1
        if self._elsewhere is not None:
            self._elsewhere.add(f"address {address}", -1)
        if self._open[address] <= 0:
            del self._open[address]

    def __len__(self) -> int:
        """How many addresses have streams; twice, if they have previews as well."""
        return len(self._open)
