"""Who has a token, found out without keeping the event loop waiting. Nothing here is ever logged."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Mapping
from types import MappingProxyType
from typing import Protocol

from posecast_relay.core.policy.policy import Principal
from posecast_relay.core.policy.share_link import is_link, read_link

TOKEN_MAX = 3000  # letters; what a viewer's message may hold
AT_ONCE = 4  # verifications of accounts; further ones wait
PATIENCE_S = 10.0


class Unverifiable(RuntimeError):
    """Whether a token is good can't be found out just now."""


class Accounts(Protocol):
    """Who signs people in."""

    def verify(self, token: str) -> Principal | None:
        """May take its time. None when the token is not good. Unverifiable."""


class Tokens:
    """Share links by the robots' keys, all else by whoever signs people in."""

    def __init__(
        self, accounts: Accounts | None = None, link_keys: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        """`link_keys`: by robot, what its share links are signed with."""
        self._link_keys = link_keys
        self._accounts = accounts
        self._turn = asyncio.Semaphore(AT_ONCE)

    async def identify(self, token: str) -> Principal | None:
        """None when it is not good. Unverifiable."""
        if is_link(token) or self._accounts is None:
            return self.identify_link(token)
        if len(token) > TOKEN_MAX:
            return None
        try:
            async with asyncio.timeout(PATIENCE_S), self._turn:
                return await asyncio.to_thread(self._accounts.verify, token)
        except TimeoutError:
            raise Unverifiable("took too long") from None

    def set_link_keys(self, link_keys: Mapping[str, str]) -> None:
        """From now on. Whoever watches by a link is judged anew by Access."""
        self._link_keys = link_keys

    def identify_link(self, token: str) -> Principal | None:
        """At once."""
        return read_link(token, self._link_keys, time.time())
