"""The door that edges come through. Zenoh reads its users and their rights only when a session is opened, so
for a robot that is enrolled or revoked the session, and nothing else, is closed and opened anew."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence
from dataclasses import replace

import zenoh

from posecast_relay.adapters.zenoh_session import Gate, ListenError, open_router, reopen_router

log = logging.getLogger("posecast_relay")


class Door:
    """Has an open session, but for the milliseconds of a change."""

    def __init__(self, endpoints: Sequence[str], gate: Gate | None) -> None:
        """ListenError."""
        self._gate = gate
        self.session, self.endpoints = open_router(endpoints, gate)
        self.closing: Callable[[], None] = lambda: None  # the session is about to go
        self.opened: Callable[[], None] = lambda: None  # there is a new one
        self._changing = asyncio.Lock()
        self.changes = 0

    def lets_in(self, robot: str) -> bool:
        """Whether it may publish now."""
        return self._gate is None or robot in self._gate.secrets

    async def admit(self, secrets: dict[str, str]) -> None:
        """Let in these robots, by name, and no others."""
        async with self._changing:
            before = self._gate
            if before is None or before.secrets == secrets:
                return
            self.closing()
            self._gate = replace(before, secrets=secrets)
            try:
                self.session = await asyncio.to_thread(self._change, self.session, self._gate)
            except ListenError as e:  # nobody may publish meanwhile; the next change tries again
                self._gate = replace(before, secrets={})
                log.error("%s", e)
                return
            self.changes += 1
            self.opened()
            came = sorted(secrets.keys() - before.secrets.keys())
            went = sorted(before.secrets.keys() - secrets.keys())
            new = sorted(r for r in secrets.keys() & before.secrets.keys() if secrets[r] != before.secrets[r])
            for what, robots in (("enrolled", came), ("revoked", went), ("with a new credential", new)):
                if robots:
                    log.warning("publishers %s: %s", what, ", ".join(robots[:20]))

    def _change(self, session: zenoh.Session, gate: Gate) -> zenoh.Session:
        session.close()  # type: ignore[no-untyped-call]
        return reopen_router(self.endpoints, gate)
