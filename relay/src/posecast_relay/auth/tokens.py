"""Verifies tokens without blocking the event loop. Nothing here is ever logged."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Mapping
from types import MappingProxyType
from typing import Protocol

from posecast_relay.core.policy import Principal, is_link, read_link
from posecast_relay.runtime.tasks import BlockingCalls

TOKEN_MAX = 3000  # characters; a viewer's message has no room for more
AT_ONCE = 4  # accounts verified in parallel; more have to wait
PATIENCE_S = 10.0


class Unverifiable(RuntimeError):
    """A token can't be verified now."""


class Accounts(Protocol):
    """A sign-in service that verifies tokens."""

    def verify(self, token: str) -> Principal | None:
        """Return who owns a token; None if it is invalid. May block. Raises Unverifiable."""


class Tokens:
    """Verifies share links with the robots' keys, and all other tokens with the sign-in service."""

    def __init__(
        self, accounts: Accounts | None = None, link_keys: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        """`link_keys`: the keys that sign share links, by robot."""
        self._link_keys = link_keys
        self._accounts = accounts
        self._calls = BlockingCalls(AT_ONCE, "sign-in")

    async def identify(self, token: str) -> Principal | None:
        """Return who owns a token; None if it is invalid.

        Raises Unverifiable if it can't be verified now.
        """
        if is_link(token) or self._accounts is None:
            return self.identify_link(token)
        if len(token) > TOKEN_MAX:
            return None
        try:
            async with asyncio.timeout(PATIENCE_S):
                return await self._calls.run(self._accounts.verify, token)
        except TimeoutError:
            raise Unverifiable("the sign-in service took too long") from None

    def set_link_keys(self, link_keys: Mapping[str, str]) -> None:
        """Replace the keys of share links. Access then checks viewers with a share link again."""
        self._link_keys = link_keys

    def identify_link(self, token: str) -> Principal | None:
        """Return who owns a share link; None if it is invalid. Does not block."""
        return read_link(token, self._link_keys, time.time())
