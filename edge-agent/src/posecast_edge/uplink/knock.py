"""Finds out what listens at a relay's endpoint: Zenoh, a web server, TLS, or nothing."""

from __future__ import annotations

import socket

KNOCK = bytes(2)  # an empty batch: Zenoh answers by closing, and the relay does not count a refusal
ANSWER_BYTES = 8  # enough to tell HTTP and TLS from Zenoh
HTTP, TLS_ALERT = b"HTTP/", b"\x15\x03"

WEB = (
    "is the port of a web page: use the relay's port for robots, 7447 by default; the relay prints it when "
    "it starts"
)


def knock(link: socket.socket) -> bytes | None:
    """The first bytes of the answer; b"" when the other side closes the connection; None when nothing arrives
    before the socket's timeout (the OS accepts connections even for a stopped process). Raises ssl.SSLError
    when the other side of a TLS link sends an alert."""
    try:
        link.sendall(KNOCK)
        return link.recv(ANSWER_BYTES)
    except TimeoutError:
        return None
    except ConnectionError:  # an answer, too
        return b""


def is_http(answer: bytes | None) -> bool:
    """Whether a web server sent this answer."""
    return answer is not None and answer.startswith(HTTP)


def is_tls(answer: bytes | None) -> bool:
    """Whether a server that requires TLS sent this answer."""
    return answer is not None and answer.startswith(TLS_ALERT)
