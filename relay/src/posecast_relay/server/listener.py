"""Opens the socket that viewers connect to, with the options that its connections inherit."""

from __future__ import annotations

import contextlib
import logging
import resource
import socket

from posecast_relay.config.settings import StartError
from posecast_relay.runtime.port_holder import explain_taken
from posecast_relay.runtime.socket_options import cut_unread

log = logging.getLogger("posecast_relay")

SPARE_FILES = 2000  # in addition to the viewers' sockets; held requests use half of them
BACKLOG = 4096  # a lecture hall opens the link at the same moment
# How long an unread answer (a file of the page, a model) is kept. Even a client that reads only a kilobyte a
# second always makes progress within this time. Streams have other limits.
UNREAD_MS = 120_000


def listen(host: str, port: int) -> socket.socket:
    """Open a listening socket; port 0 means any free port. Raises StartError if it can't be opened."""
    try:
        family, kind, proto, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.socket(family, kind, proto)
    except UnicodeError:
        raise StartError(f"--host {host}: not a host name") from None
    except OSError as e:
        raise StartError(f"--host {host}: {e.strerror}") from None
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    cut_unread(listener, UNREAD_MS)
    try:
        listener.bind(address)
        listener.listen(BACKLOG)
    except OSError as e:
        listener.close()
        raise StartError(f"http://{host}:{port}: {explain_taken(e, port)}") from None
    return listener


def allow_sockets(viewers: int) -> None:
    """Raise the limit of open files, usually 1,024, so that each viewer can have a socket."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = viewers + SPARE_FILES
    if hard != resource.RLIM_INFINITY:
        wanted = min(wanted, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
            soft = wanted
    if soft != resource.RLIM_INFINITY and soft < viewers + SPARE_FILES:
        log.warning("only %d open files allowed: fewer viewers than --max-viewers %d", soft, viewers)
