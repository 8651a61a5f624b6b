"""Asks a relay by HTTP. Answers are bounded in bytes and time; what fails for a while is asked again."""

from __future__ import annotations

import asyncio
import math
import os
import re
import socket
import ssl
import time
from collections.abc import Callable
from typing import NamedTuple

import httpx
from posecast_wire.checked import loads, make_visible

from posecast_relay.recording.source import PartAway, PastDamaged, PastUnreadable

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
    said = doc.get("error") if isinstance(doc, dict) else None
    return make_visible(said) if isinstance(said, str) and said else f"status {answer.status}"


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
