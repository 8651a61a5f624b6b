"""Reads the past of a running relay by its routes (docs/reference/protocol.md, *The past*)."""

from __future__ import annotations

import asyncio
import hashlib
import math
import os
import re
import socket
import ssl
import time
from collections.abc import Callable
from http import HTTPStatus
from typing import NamedTuple
from urllib.parse import quote

import httpx
from posecast_wire.checked import loads, make_visible
from posecast_wire.keys import ROBOT_ID
from posecast_wire.messages import COUNT_MAX
from posecast_wire.schema import TEXT_BYTES_MAX as SCHEMA_BYTES_MAX
from posecast_wire.segment.envelope import ENVELOPE_BYTES_MAX
from posecast_wire.segment.frame_chain import SEQS

from posecast_relay.archive.names import read_day
from posecast_relay.models.manifest import BYTES_MAX as MANIFEST_BYTES_MAX
from posecast_relay.past.address import write_minute
from posecast_relay.past.segment import DAY_MS, PAGE_MS, SHA256, U64
from posecast_relay.recording.source import ListedSegment, PartAway, PastDamaged, PastUnreadable, SourceSpan

AT_ONCE = 8  # requests
TIMEOUT_S = 20.0  # of a wait; a relay holds a request for 8 s at most
# an answer that only trickles in is given up after SLOW_S, and the time that its bytes take at SLOW_BYTES_S
SLOW_S, SLOW_BYTES_S = 60.0, 10_000
AGAIN_S = 60.0  # for so long a request is repeated after a 503 or a lost connection
WAIT_S, WAIT_S_MAX = 0.25, 10.0  # before it is repeated: at first, and at most
ERROR_BYTES_MAX = 4096
BUSY = (429, 502, 503, 504)
ADDRESS = re.compile(r"https?://[^\s/?#@]+(/[^\s?#]*)?", re.ASCII | re.IGNORECASE)


class RelayAnswer(NamedTuple):
    """What a relay answered, whole. `body` may be longer than was allowed: then it is not whole."""

    status: int
    type: str
    retry_after: str
    body: bytes


class RelayClient:
    """Asks the relay at `address`, with a token if there is one. Redirects are not followed: the
    token goes nowhere else."""

    def __init__(self, address: str, token: str | None, now: Callable[[], float] = time.monotonic) -> None:
        """`now`: seconds of a clock that never goes back.

        Raises PastUnreadable when `address` is not the address of a relay.
        """
        self._now = now
        self.address = address.rstrip("/")
        try:
            if not ADDRESS.fullmatch(address) or not 0 < (httpx.URL(self.address).port or 1) < 1 << 16:
                raise ValueError
            if not httpx.URL(self.address).host:
                raise ValueError
        except (ValueError, httpx.InvalidURL):
            shown = make_visible(address)
            raise PastUnreadable(
                f"{shown}: not the address of a relay: use http://HOST:PORT or https://HOST"
            ) from None
        headers = {"accept": "*/*", "accept-encoding": "identity", "user-agent": "posecast-relay past export"}
        if token is not None:
            headers["authorization"] = f"Bearer {token}"
        self._http = httpx.AsyncClient(
            headers=headers,
            timeout=httpx.Timeout(TIMEOUT_S, pool=None),
            verify=ssl.create_default_context(),
            trust_env=False,
        )
        self._gate = asyncio.Semaphore(AT_ONCE)
        self._has_answered = False

    async def close(self) -> None:
        """End what is left of connections."""
        await self._http.aclose()

    async def ask(self, path: str, bytes_max: int, patience_s: float | None = None) -> RelayAnswer:
        """Return the answer to a GET; repeat it while the relay is busy or away, for `patience_s` (AGAIN_S).
        Raises PastUnreadable; PartAway when the relay answered, but did not have it in time."""
        patience_s = AGAIN_S if patience_s is None else patience_s
        end_s = self._now() + patience_s
        wait_s = WAIT_S
        while True:
            pause_s, refusal = wait_s, PastUnreadable
            try:
                async with self._gate:
                    answer = await self._get(path, bytes_max)
            except (httpx.HTTPError, TimeoutError) as e:
                cause = find_cause(e)
                if isinstance(cause, ssl.SSLCertVerificationError):
                    raise self.refuse(
                        path, f"its certificate is not trusted: {cause.verify_message}"
                    ) from None
                why = describe_error(e, cause)
                if not self._has_answered:  # nobody is there, or it is another address
                    if isinstance(cause, ConnectionRefusedError):
                        why += "; is it another address? --relay URL"
                    raise self.refuse(path, why) from None
            else:
                self._has_answered = True
                if answer.status not in BUSY:
                    break
                why, refusal = read_reason(answer), PartAway
                pause_s = _read_seconds(answer.retry_after, wait_s)
            if self._now() + pause_s > end_s:
                waited = f"gave up after {patience_s:g} s: " if patience_s else ""
                raise refusal(str(self.refuse(path, waited + why)))
            await asyncio.sleep(pause_s)
            wait_s = min(2 * wait_s, WAIT_S_MAX)
        if len(answer.body) > bytes_max:
            raise PastDamaged(str(self.refuse(path, f"the answer is over {bytes_max} bytes")))
        return answer

    def refuse(self, path: str, why: str) -> PastUnreadable:
        """Make the error for what was asked."""
        return PastUnreadable(f"{self.address}{path}: {why}")

    async def _get(self, path: str, bytes_max: int) -> RelayAnswer:
        body = bytearray()
        async with (
            asyncio.timeout(SLOW_S) as limit,
            self._http.stream("GET", self.address + path) as answer,
        ):
            end_s = limit.when() or 0.0
            most = bytes_max if answer.status_code == httpx.codes.OK else ERROR_BYTES_MAX
            async for part in answer.aiter_raw():
                body += part
                limit.reschedule(end_s + len(body) / SLOW_BYTES_S)
                if len(body) > most:
                    break
        kind = answer.headers.get("content-type", "").partition(";")[0].strip().lower()
        return RelayAnswer(answer.status_code, kind, answer.headers.get("retry-after", ""), bytes(body))


def read_reason(answer: RelayAnswer) -> str:
    """Return the relay's own line about a refusal, else its status."""
    try:
        doc = loads(answer.body)
    except ValueError:
        doc = None
    reason = doc.get("error") if isinstance(doc, dict) else None
    return make_visible(reason) if isinstance(reason, str) and reason else f"status {answer.status}"


def find_cause(error: BaseException) -> BaseException:
    """Return the operating system's error behind an error of the library; else the innermost one."""
    while not isinstance(error, OSError) or not error.strerror:
        several = error.exceptions if isinstance(error, BaseExceptionGroup) else ()
        inner = several[0] if several else error.__cause__ or error.__context__
        if inner is None:
            break
        error = inner
    return error


def describe_error(error: Exception, cause: BaseException) -> str:
    """Return why there was no answer, in a few words."""
    if isinstance(error, TimeoutError):
        return f"too slow: under {SLOW_BYTES_S // 1000} kB/s after {SLOW_S:g} s"
    if isinstance(error, httpx.TimeoutException):
        return f"no answer within {TIMEOUT_S:g} s"
    if isinstance(cause, OSError):
        is_system = cause.errno and not isinstance(cause, socket.gaierror | ssl.SSLError)
        return (os.strerror(cause.errno or 0) if is_system else cause.strerror or str(cause)).lower()
    return "cut short" if isinstance(error, httpx.RemoteProtocolError) else "the answer is not HTTP"


def _read_seconds(text: str, otherwise_s: float) -> float:
    try:
        seconds = float(text)
    except ValueError:
        return otherwise_s
    return min(max(seconds, otherwise_s), WAIT_S_MAX) if math.isfinite(seconds) else otherwise_s


PAGE_BYTES_MAX = 4 << 20  # of one answer; a relay sends the index of ten minutes in parts of 1 MiB
PARTS_MAX = 1000  # that one index may have
NEXT, NEXT_WITHIN = b'"next"', 16  # in what a relay answers for a segment that is gone
OCTETS = "application/octet-stream"


async def list_robots(relay: str) -> list[str]:
    """Return the names of the robots that a relay lists for anyone. Raises PastUnreadable."""
    client = RelayClient(relay, None)
    try:
        doc = await _ask_json(client, "/api/v1/robots")
        robots = doc.get("robots")
        if not isinstance(robots, list) or not all(isinstance(robot, dict) for robot in robots):
            raise client.refuse("/api/v1/robots", "not the answer of a relay (robots)")
        return [
            name
            for robot in robots
            if isinstance(name := robot.get("robot"), str) and ROBOT_ID.fullmatch(name)
        ]
    finally:
        await client.close()


async def _ask_json(client: RelayClient, path: str) -> dict[str, object]:
    answer = await client.ask(path, PAGE_BYTES_MAX)
    if answer.status != HTTPStatus.OK:
        raise client.refuse(path, read_reason(answer))
    try:
        doc = loads(answer.body)
    except ValueError:
        doc = None
    if not isinstance(doc, dict):
        raise client.refuse(path, "not the answer of a relay")
    return doc


class HttpSource:
    """The past of a robot at a relay, as the bearer of a token may see it, or anyone without one."""

    def __init__(
        self,
        relay: str,
        robot: str,
        view: str | None,
        token: str | None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """`relay`: `http://…` or `https://…`; `view` None: the one that the asker gets; `now`: seconds of a
        clock that never goes back. Raises PastUnreadable when `relay` is no address."""
        self.robot = robot
        self._view = view
        self._days: frozenset[int | None] | None = None  # of which there is something; None: unknown
        self._client = RelayClient(relay, token, now)
        self._base = f"/api/v1/robots/{robot}"
        self._waits_for_model = True

    @property
    def view(self) -> str:
        """The view's name; of the one that the asker gets, once `find_span` has asked."""
        return self._view or ""

    async def close(self) -> None:
        """End what is left of connections."""
        await self._client.close()

    async def find_span(self) -> SourceSpan | None:
        """Return from when to when one may look back. Raises PastUnreadable, also where one never may."""
        path = f"{self._base}/past" + ("" if self._view is None else f"?view={quote(self._view, safe='')}")
        doc = await _ask_json(self._client, path)
        view, from_ms, to_ms = (doc.get(name) for name in ("view", "from_ms", "to_ms"))
        if not isinstance(view, str) or not ROBOT_ID.fullmatch(view):
            raise self._client.refuse(path, "not the answer of a relay (view)")
        self._view = view
        if doc.get("past_ms") == 0:
            raise self._client.refuse(path, "no past is kept there, or none that you may see")
        if from_ms is None or to_ms is None:
            return None
        try:
            self._days = frozenset(read_day(str(day)) for day in _read_list(doc.get("days")))
            return SourceSpan(_read_count(from_ms), _read_count(to_ms))
        except ValueError:
            raise self._client.refuse(path, "not the answer of a relay (from_ms, to_ms, days)") from None

    async def list_segments(self, from_ms: int, to_ms: int) -> list[ListedSegment]:
        """Read the index of each ten minutes of a span, on days of which there is something. Raises
        PastUnreadable."""
        found: dict[tuple[int, int], ListedSegment] = {}
        for page_ms in range(from_ms - from_ms % PAGE_MS, to_ms, PAGE_MS):
            if self._days is not None and page_ms - page_ms % DAY_MS not in self._days:
                continue
            for each in await self._list_page(page_ms):
                if from_ms <= each.from_ms < to_ms:
                    found[each.take, each.index] = each
        return [*found.values()]

    async def load_segment(self, segment: ListedSegment) -> bytes | None:
        """Ask for a segment. Raises PastUnreadable."""
        path = f"{self._base}/past/{self.view}/{segment.take:016x}/{segment.index}"
        answer = await self._ask(path, ENVELOPE_BYTES_MAX, segment.sha256)
        if answer is None or (answer.type != OCTETS and NEXT in answer.body[:NEXT_WITHIN]):
            return None
        if answer.type != OCTETS:
            kind = make_visible(answer.type) if answer.type else "none"
            raise PastDamaged(f"not a segment: its Content-Type is {kind}, not {OCTETS}")
        return answer.body

    async def load_schema(self, sha256: str) -> str | None:
        """Ask for a schema. Raises PastUnreadable."""
        answer = await self._ask(f"{self._base}/past/{self.view}/schema/{sha256}", SCHEMA_BYTES_MAX, sha256)
        return None if answer is None else answer.body.decode(errors="replace")

    async def load_manifest(self, model: str) -> bytes | None:
        """Ask for a manifest. Raises PastUnreadable; PartAway when the relay can't get it from the robot."""
        return await self._ask_model(f"{model}/manifest.json", MANIFEST_BYTES_MAX, model)

    async def load_model_file(self, model: str, path: str, sha256: str, size: int) -> bytes | None:
        """Ask for a model's file. Raises PastUnreadable; PartAway as above."""
        return await self._ask_model(f"{model}/{quote(path)}", size, sha256)

    async def _list_page(self, page_ms: int) -> list[ListedSegment]:
        page = f"{self._base}/past/{self.view}/{write_minute(page_ms)}"
        listed: list[ListedSegment] = []
        path = page
        for _ in range(PARTS_MAX):
            doc = await _ask_json(self._client, path)
            try:
                part = [_read_entry(entry) for entry in _read_list(doc.get("segments"))]
            except ValueError:
                raise self._client.refuse(path, "not the answer of a relay (segments)") from None
            listed += part
            if doc.get("more") is not True or not part:
                return listed
            path = f"{page}?after={part[-1].take:016x},{part[-1].index}"
        raise self._client.refuse(path, "the index does not end")

    async def _ask_model(self, path: str, bytes_max: int, sha256: str) -> bytes | None:
        """Ask for one of a model's files. A relay without an archive gets files that it lacks from the robot;
        if that is off, nothing is waited for; otherwise, waiting for one file is enough."""

        async def ask(patience_s: float) -> bytes | None:
            answer = await self._ask(f"{self._base}/model/{path}", bytes_max, sha256, patience_s)
            return None if answer is None else answer.body

        if self._waits_for_model:
            try:
                return await ask(0.0)
            except PastDamaged:
                raise
            except PastUnreadable:
                self._waits_for_model = not await self._is_off()
        try:
            return await ask(AGAIN_S if self._waits_for_model else 0.0)
        except PartAway:
            self._waits_for_model = False
            raise

    async def _is_off(self) -> bool:
        """Whether the relay says that the robot is off."""
        try:
            answer = await self._client.ask(self._base, PAGE_BYTES_MAX, 0.0)
            doc = loads(answer.body) if answer.status == HTTPStatus.OK else None
        except (PastUnreadable, PastDamaged, ValueError):
            return False
        return answer.status == HTTPStatus.NOT_FOUND or (
            isinstance(doc, dict) and doc.get("status") == "offline"
        )

    async def _ask(
        self, path: str, bytes_max: int, sha256: str | None, patience_s: float | None = None
    ) -> RelayAnswer | None:
        """The answer, whose bytes have this SHA-256; None where there is nothing (any more) for us."""
        for _ in range(2):
            answer = await self._client.ask(path, bytes_max, patience_s)
            if answer.status in (HTTPStatus.NOT_FOUND, HTTPStatus.NO_CONTENT):
                return None
            if answer.status != HTTPStatus.OK:
                raise self._client.refuse(path, read_reason(answer))
            is_json = answer.type != OCTETS and NEXT in answer.body[:NEXT_WITHIN]
            if is_json or sha256 in (None, hashlib.sha256(answer.body).hexdigest()):
                return answer
        why = "damaged twice in transit: its SHA-256 does not match"
        raise PastDamaged(str(self._client.refuse(path, why)))


def _read_entry(entry: object) -> ListedSegment:
    """A segment of an index. Raises ValueError."""
    if not isinstance(entry, dict):
        raise ValueError
    take, sha256 = entry.get("take"), entry.get("sha256")
    if not isinstance(take, str) or not U64.fullmatch(take):
        raise ValueError
    if not isinstance(sha256, str) or not SHA256.fullmatch(sha256):
        raise ValueError
    index, from_ms, to_ms = (_read_count(entry.get(name)) for name in ("index", "from_ms", "to_ms"))
    if index >= SEQS:
        raise ValueError
    return ListedSegment(int(take, 16), index, from_ms, to_ms, sha256)


def _read_list(value: object) -> list[object]:
    if not isinstance(value, list):
        raise ValueError
    return value


def _read_count(value: object) -> int:
    if type(value) is not int or not 0 <= value <= COUNT_MAX:
        raise ValueError
    return value
