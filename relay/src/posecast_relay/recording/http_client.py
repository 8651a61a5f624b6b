"""Asks a relay by HTTP: connections that are kept, answers that are bounded; what may pass is asked again."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import math
import re
import socket
import ssl
import time
from concurrent.futures import ThreadPoolExecutor
from threading import Event, Timer, local
from typing import NamedTuple
from urllib.parse import urlsplit

from posecast_wire.checked import loads, make_visible

from posecast_relay.recording.source import PastDamaged, PastUnreadable

AT_ONCE = 8  # requests
TIMEOUT_S = 20.0  # of one; a relay holds a request for 8 s at most
# an answer that comes in drops is given up, though none of its waits is long: it has so long, and for its
SLOW_S, SLOW_BYTES_S = 60.0, 10_000  # bytes at this pace
READ_BYTES = 65_536
AGAIN_S = 60.0  # for so long what may pass (503, a lost connection) is asked again
WAIT_S, WAIT_S_MAX = 0.25, 10.0  # before that
ERROR_BYTES_MAX = 4096
BUSY = (429, 502, 503, 504)
ADDRESS = re.compile(r"https?://[^\s/?#@]+(/[^\s?#]*)?", re.ASCII | re.IGNORECASE)


class SlowAnswerError(http.client.HTTPException):
    """An answer came too slowly to wait for its end."""


class RelayAnswer(NamedTuple):
    """What a relay answered, whole. `body` may be one byte longer than was allowed: then it is too long."""

    status: int
    type: str
    retry_after: str
    body: bytes


class RelayClient:
    """Asks the relay at `address`, with a token if there is one. Redirects are not followed: a token goes
    nowhere else."""

    def __init__(self, address: str, token: str | None) -> None:
        """Raises PastUnreadable when `address` is none."""
        self.address = address.rstrip("/")
        parts = urlsplit(self.address) if ADDRESS.fullmatch(address) else None
        try:
            if parts is None or not parts.hostname or parts.port == 0:
                raise ValueError
        except ValueError:
            shown = make_visible(address)
            raise PastUnreadable(
                f"{shown}: no address of a relay: use http://HOST:PORT or https://HOST"
            ) from None
        self._is_secure = parts.scheme.lower() == "https"
        self._host, self._port, self._path = parts.hostname, parts.port, parts.path
        self._headers = {"accept": "*/*", "user-agent": "posecast-relay past export"}
        if token is not None:
            self._headers["authorization"] = f"Bearer {token}"
        self._trust = ssl.create_default_context() if self._is_secure else None
        self._pool = ThreadPoolExecutor(AT_ONCE, "export")
        self._kept = local()
        self._links: set[http.client.HTTPConnection] = set()
        self._has_answered = False
        self._is_closed = False

    def close(self) -> None:
        """End what is under way, and the connections."""
        self._is_closed = True
        self._pool.shutdown(wait=False, cancel_futures=True)
        for link in tuple(self._links):
            if link.sock is not None:
                with contextlib.suppress(OSError):
                    link.sock.shutdown(socket.SHUT_RDWR)  # wakes the thread that reads

    async def ask(self, path: str, bytes_max: int) -> RelayAnswer:
        """Return the answer to a GET, once nothing stands in the way that may pass. Raises PastUnreadable."""
        loop = asyncio.get_running_loop()
        end_s = loop.time() + AGAIN_S
        wait_s = WAIT_S
        while True:
            pause_s = wait_s
            try:
                answer = await loop.run_in_executor(self._pool, self._get, path, bytes_max)
            except ssl.SSLCertVerificationError as e:
                raise self.refuse(path, f"its certificate is not trusted: {e.verify_message}") from None
            except (OSError, http.client.HTTPException) as e:
                why = describe_error(e)
                if not self._has_answered:  # nobody is there, or it is another address
                    if isinstance(e, ConnectionRefusedError):
                        why += "; is it another address? --relay URL"
                    raise self.refuse(path, why) from None
            else:
                self._has_answered = True
                if answer.status not in BUSY:
                    break
                why = read_reason(answer)
                pause_s = _read_seconds(answer.retry_after, wait_s)
            if loop.time() + pause_s > end_s:
                raise self.refuse(path, f"for {AGAIN_S:g} s: {why}")
            await asyncio.sleep(pause_s)
            wait_s = min(2 * wait_s, WAIT_S_MAX)
        if len(answer.body) > bytes_max:
            raise PastDamaged(str(self.refuse(path, f"answers more than {bytes_max} bytes")))
        return answer

    def refuse(self, path: str, why: str) -> PastUnreadable:
        """Make the error for what was asked."""
        return PastUnreadable(f"{self.address}{path}: {why}")

    def _get(self, path: str, bytes_max: int) -> RelayAnswer:
        """Ask once, or twice where a connection that was kept has ended meanwhile. Raises OSError and
        HTTPException."""
        kept: http.client.HTTPConnection | None = getattr(self._kept, "link", None)
        if kept is not None:
            try:
                return self._exchange(kept, path, bytes_max)
            except (ConnectionError, http.client.RemoteDisconnected):
                pass
        self._kept.link = link = self._connect()
        self._links.add(link)
        return self._exchange(link, path, bytes_max)

    def _connect(self) -> http.client.HTTPConnection:
        if self._trust is not None:
            return http.client.HTTPSConnection(self._host, self._port, timeout=TIMEOUT_S, context=self._trust)
        return http.client.HTTPConnection(self._host, self._port, timeout=TIMEOUT_S)

    def _exchange(self, link: http.client.HTTPConnection, path: str, bytes_max: int) -> RelayAnswer:
        try:
            link.request("GET", self._path + path, headers=self._headers)
            if self._is_closed:  # while it was connecting, when nobody could end that
                raise ConnectionAbortedError
            began_s = time.monotonic()
            answer = _await_head(link)
            most = bytes_max if answer.status == http.HTTPStatus.OK else ERROR_BYTES_MAX
            body = _read_body(answer, most + 1, began_s)
            if len(body) <= most and answer.length:  # bytes that are still to come, and do not
                raise http.client.IncompleteRead(body, answer.length)
            if not answer.isclosed():  # not read to its end: nothing can follow on this connection
                self._drop(link)
            kind = (answer.getheader("content-type") or "").partition(";")[0].strip().lower()
            return RelayAnswer(answer.status, kind, answer.getheader("retry-after") or "", body)
        except BaseException:
            self._drop(link)
            raise

    def _drop(self, link: http.client.HTTPConnection) -> None:
        link.close()
        self._links.discard(link)
        self._kept.link = None


def _await_head(link: http.client.HTTPConnection) -> http.client.HTTPResponse:
    """The head of an answer, which has SLOW_S: then its connection ends. Raises as `getresponse`, and
    SlowAnswerError."""
    is_late = Event()

    def end() -> None:
        is_late.set()
        if link.sock is not None:
            with contextlib.suppress(OSError):
                link.sock.shutdown(socket.SHUT_RDWR)

    timer = Timer(SLOW_S, end)
    timer.daemon = True
    timer.start()
    try:
        answer = link.getresponse()
    except Exception:
        if is_late.is_set():
            raise SlowAnswerError from None
        raise
    finally:
        timer.cancel()
    if is_late.is_set():  # what ends in the middle of a head reads like a whole one
        raise SlowAnswerError
    return answer


def _read_body(answer: http.client.HTTPResponse, most: int, began_s: float) -> bytes:
    """Up to `most` bytes. Raises as `read`, and SlowAnswerError."""
    body = bytearray()
    while len(body) < most and (part := answer.read1(min(READ_BYTES, most - len(body)))):
        body += part
        if time.monotonic() - began_s > SLOW_S + len(body) / SLOW_BYTES_S:
            raise SlowAnswerError
        if answer.length == 0:
            answer.read()  # by which it knows that it is over, and its connection may be kept
            break
    return bytes(body)


def read_reason(answer: RelayAnswer) -> str:
    """Return the relay's own line about a refusal, else its status."""
    try:
        doc = loads(answer.body)
    except ValueError:
        doc = None
    said = doc.get("error") if isinstance(doc, dict) else None
    return make_visible(said) if isinstance(said, str) and said else f"status {answer.status}"


def describe_error(error: Exception) -> str:
    """Return why there was no answer, in a few words."""
    if isinstance(error, TimeoutError):
        return f"no answer within {TIMEOUT_S:g} s"
    if isinstance(error, OSError):
        return (error.strerror or str(error) or type(error).__name__).lower()
    if isinstance(error, SlowAnswerError):
        return f"cut short: after {SLOW_S:g} s it was slower than {SLOW_BYTES_S // 1000} kB/s"
    return "no answer of HTTP" if not isinstance(error, http.client.IncompleteRead) else "cut short"


def _read_seconds(text: str, otherwise_s: float) -> float:
    try:
        seconds = float(text)
    except ValueError:
        return otherwise_s
    return min(max(seconds, otherwise_s), WAIT_S_MAX) if math.isfinite(seconds) else otherwise_s
