"""Copies the public views to a Firebase Realtime Database, for pages that can't reach a relay.

The mirror runs in one task and sends one request at a time, with a timeout of 5 s. It pauses after three
failures in a row. It never writes views that are not public, and deletes them if they exist. It uses the
database's REST API directly, because firebase-admin blocks a thread for seconds when the database is away.
"""

from __future__ import annotations

import asyncio
import json
import logging
import random
from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import chain

import google.auth
import google.auth.exceptions
import google.auth.transport.requests
import httpx
from google.auth.credentials import Credentials

from posecast_relay.auth.access import Access
from posecast_relay.core.policy import ANYONE, Applicant, Grant
from posecast_relay.kit import Breaker
from posecast_relay.mirror.changes import HZ, Mirror, NodeChange, VisibleRobot
from posecast_relay.runtime.tasks import BlockingCalls

log = logging.getLogger("posecast_relay")

ROOT = "posecast"
GIVE_UP_S = 5.0
BATCH_BYTES = 1_000_000  # of a request; further robots go into the next one
SCOPES = tuple(f"https://www.googleapis.com/auth/{name}" for name in ("firebase.database", "userinfo.email"))
OWNER = "owner"  # the token that emulators and test doubles accept as a service account


class ServiceAccount:
    """The service account from `GOOGLE_APPLICATION_CREDENTIALS` or the platform."""

    def __init__(self) -> None:
        self._credentials: Credentials | None = None
        self._calls = BlockingCalls(1, "service account")

    async def get_token(self) -> str:
        """Return an access token; get a new one once an hour, in a thread. Raises GoogleAuthError."""
        found = self._credentials
        if found is None or not found.valid:
            found = await self._calls.run(self._fetch)
        return str(found.token)

    def _fetch(self) -> Credentials:
        if self._credentials is None:
            self._credentials, _project = google.auth.default(scopes=SCOPES)
        found = self._credentials
        request = google.auth.transport.requests.Request()
        found.refresh(request)  # type: ignore[no-untyped-call]
        return found


class FirebaseMirror:
    """Writes the public views of `access` to the database at `url`, at 2 Hz at most."""

    def __init__(self, url: str, access: Access) -> None:
        self.written: Counter[str] = Counter()  # requests: sent, failed
        self.breaker = Breaker()
        self._url = f"{url.rstrip('/')}/{ROOT}.json"
        self._access = access
        # a database without TLS is on this machine and needs no account
        self._account = ServiceAccount() if url.startswith("https:") else None
        self._mirror = Mirror()
        self._adopted = False

    async def run(self) -> None:
        """Write changes until cancelled. The data stays in the database; its age shows that it is old."""
        now = self._access.live.now
        async with httpx.AsyncClient(timeout=GIVE_UP_S, trust_env=self._account is not None) as client:
            due = now()
            while True:
                await asyncio.sleep(max(0.0, due - now()))
                due = now() + 1 / HZ
                if not self.breaker.allow(now()):
                    continue
                try:
                    await self._look(client)
                except Exception:  # a bug in the relay: one robot must not stop the mirror of all others
                    log.exception("mirror")
                    self._failed("internal error of the relay")

    async def _look(self, client: httpx.AsyncClient) -> None:
        """Write everything that has changed since the last call."""
        live = self._access.live
        if not self._adopted:
            found = await self._ask(client, "GET", {"shallow": "true"})
            if found is None:
                return
            self._mirror.record_existing(found)
            self._adopted = True
        changes = self._mirror.find_changes(dict(self._shown()), live.now(), live.unix_s())
        for batch, body in split_batches(changes):
            if await self._ask(client, "PATCH", {"print": "silent"}, body) is None:
                self._mirror.record_lost(changes)  # and later batches: they are made again
                return
            self._mirror.record_written(batch)

    def _shown(self) -> Iterator[tuple[str, VisibleRobot]]:
        """Yield the public robots, except those with a limit of viewers: a mirror can't count viewers."""
        live = self._access.live
        for name in [robot.name for robot in live.hub.robots.values() if robot.heard_at is not None]:
            try:
                shown = self._shown_of(name)
            except Exception as e:
                live.report_fault("a robot in the mirror", e)
                continue
            if shown is not None:
                yield name, shown

    def _shown_of(self, name: str) -> VisibleRobot | None:
        grant = self._access.admit(Applicant(name, who=ANYONE))
        if not isinstance(grant, Grant) or grant.viewers is not None:
            return None
        robot, room = self._access.find_robot(grant) or (None, None)
        if robot is None or room is None:
            return None
        return VisibleRobot(room.stream, robot.compute_status(room, self._access.live.now()), grant.hz)

    async def _ask(
        self, client: httpx.AsyncClient, method: str, parameters: dict[str, str], body: bytes | None = None
    ) -> list[str] | None:
        """Send a request and return the names in the answer. On failure, count it and return None."""
        try:
            async with asyncio.timeout(GIVE_UP_S):
                token = OWNER if self._account is None else await self._account.get_token()
                answer = await client.request(
                    method,
                    self._url,
                    params=parameters,
                    content=body,
                    headers={"authorization": f"Bearer {token}"},
                )
                answer.raise_for_status()
                names = answer.json() if method == "GET" else None
        except httpx.HTTPStatusError as e:
            self._failed(f"HTTP {e.response.status_code}")
            return None
        except (httpx.HTTPError, TimeoutError, ValueError, google.auth.exceptions.GoogleAuthError) as e:
            self._failed(type(e).__name__)
            return None
        self.written["sent"] += 1
        if self.breaker.record_success():
            log.warning("mirror: the database answers again")
        return list(names) if isinstance(names, dict) else []

    def _failed(self, why: str) -> None:
        self.written["failed"] += 1
        now = self._access.live.now()
        if self.breaker.record_failure(now):
            log.warning("mirror: writing to the database failed (%s); retrying less often", why)
        self.breaker.postpone(random.random())  # spreads the retries of several relays


def split_batches(changes: Mapping[str, NodeChange]) -> Iterator[tuple[dict[str, NodeChange], bytes]]:
    """Split changes into requests of about BATCH_BYTES, each with its body.

    A body is a multi-path update, which the database applies atomically.
    """
    batch: dict[str, NodeChange] = {}
    parts: list[str] = []
    size = 0
    for robot, change in chain(changes.items(), [(None, None)]):
        if robot is None or change is None or (size > BATCH_BYTES and batch):
            if batch:
                yield batch, ("{" + ",".join(parts) + "}").encode()
            batch, parts, size = {}, [], 0
        if robot is not None and change is not None:
            node = change.node
            update = {robot: None} if node is None else {f"{robot}/{name}": node[name] for name in node}
            text = json.dumps(update, separators=(",", ":"))[1:-1]
            batch[robot] = change
            parts.append(text)
            size += len(text)
