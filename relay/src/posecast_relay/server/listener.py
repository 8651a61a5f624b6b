"""Opens the socket that viewers connect to, with the options that its connections inherit."""

from __future__ import annotations

import socket

from posecast_relay.config.settings import StartError
from posecast_relay.runtime.socket_options import cut_unread

BACKLOG = 4096  # a lecture hall opens the link at once
# An answer (a file of the page, a model) that nobody reads is kept so long; at a kilobyte a second some of it
# is always read. Streams have limits of their own.
UNREAD_MS = 120_000


def listen_first(host: str, port: int) -> socket.socket:
    """Open a listening socket on a port that other workers of this relay will share, and nobody else has.

    Raises StartError when it can't be opened.
    """
    with listen(host, port) as alone:  # which fails where another relay shares its port among its workers
        port = alone.getsockname()[1]
    return listen(host, port, is_shared=True)


def listen(host: str, port: int, is_shared: bool = False) -> socket.socket:
    """Open a listening socket; port 0 means any free one. Raises StartError when it can't be opened.

    `is_shared`: other processes of this user may listen there as well; each gets a part of the connections.
    """
    try:
        family, kind, proto, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.socket(family, kind, proto)
    except OSError as e:
        raise StartError(f"--host {host}: {e.strerror}") from None
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    if is_shared:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
    cut_unread(listener, UNREAD_MS)
    try:
        listener.bind(address)
        listener.listen(BACKLOG)
    except OSError as e:
        listener.close()
        raise StartError(f"http://{host}:{port}: {(e.strerror or str(e)).lower()}") from None
    return listener
