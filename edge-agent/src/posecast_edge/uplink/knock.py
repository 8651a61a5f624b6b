"""Asks what listens at an endpoint that is said to be a relay's: Zenoh, a web server, TLS, or nobody."""

from __future__ import annotations

import socket

KNOCK = bytes(2)  # an empty batch: Zenoh says goodbye to it, and the relay counts nobody as refused
ANSWER_BYTES = 8  # enough to tell HTTP and TLS from Zenoh
HTTP, TLS_ALERT = b"HTTP/", b"\x15\x03"

WEB = (
    "is the port of a web page: robots have another, 7447 unless the relay is told otherwise; it names it "
    "when it starts"
)


def knock(link: socket.socket) -> bytes | None:
    """The first bytes of the answer, b"" when the other side hangs up. None when nobody answers before the
    socket's timeout: a system takes connections also for a process that stands still. Raises ssl.SSLError on
    a TLS link whose other side breaks it off by an alert."""
    try:
        link.sendall(KNOCK)
        return link.recv(ANSWER_BYTES)
    except TimeoutError:
        return None
    except ConnectionError:  # a word, too
        return b""


def is_http(answer: bytes | None) -> bool:
    """Whether it is a web server that answers so."""
    return answer is not None and answer.startswith(HTTP)


def is_tls(answer: bytes | None) -> bool:
    """Whether it is somebody who wants TLS that answers so."""
    return answer is not None and answer.startswith(TLS_ALERT)
