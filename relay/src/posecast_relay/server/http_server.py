"""The HTTP server of a process: the socket that viewers connect to, with the options that its connections
inherit, and uvicorn, extended to move viewers away before it stops.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import logging
import os
import resource
import signal
import socket
import threading
from collections.abc import Callable, Iterator, Sequence

import uvicorn
from fastapi import FastAPI

from posecast_relay.auth.access import Access
from posecast_relay.config.settings import StartError
from posecast_relay.net.encodings import DecodeCache
from posecast_relay.net.http1 import HttpConnection, make_plain_http_protocol
from posecast_relay.net.sse import make_http_protocol
from posecast_relay.net.websocket import make_live_protocol
from posecast_relay.runtime.dispatcher import Dispatcher
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


GRACE_S = 2  # for running requests when the relay stops
DATE_TICKS = 10  # calls of on_tick between two updates of uvicorn's Date header
END_S = 9.5  # after SIGTERM; platforms kill a process at 10 s


class RelayServer(uvicorn.Server):
    """uvicorn without its signal handlers, which close all connections at once and exit by the signal."""

    def __init__(
        self,
        config: uvicorn.Config,
        dispatchers: Sequence[Dispatcher],
        serving: Callable[[], None],
        leaving: Callable[[], None],
    ) -> None:
        """`serving` is called when the server starts to accept connections.

        `leaving` is called when the relay begins to stop, before viewers are moved away.
        """
        super().__init__(config)
        self._dispatchers = dispatchers
        self._serving = serving
        self._leaving = leaving
        self._listeners: list[socket.socket] = []

    def obey_signals(self) -> None:
        """Leave on SIGTERM and Ctrl-C."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(number, self.leave)

    def leave(self) -> None:
        """Move the viewers away, then stop. A second call stops at once."""
        going = self._dispatchers[0].draining
        self.force_exit = self.should_exit = going
        if not going:
            last = threading.Timer(END_S, _end)
            last.daemon = True
            last.start()
            self._leaving()
            self._take_no_more()
        for dispatcher in self._dispatchers:
            dispatcher.drain()

    def _take_no_more(self) -> None:
        """Accept no more connections, and close those without a running request.

        If the port is closed, a proxy tries another relay at once. If this relay accepted a viewer only to
        send it away, the proxy could send it here again.
        """
        if not self.started:
            return
        for server in self.servers:
            server.close()
        for listener in self._listeners:
            listener.close()
        for connection in list(self.server_state.connections):
            if isinstance(connection, HttpConnection):
                connection.close_if_idle()

    async def on_tick(self, counter: int) -> bool:
        """Return whether to stop. uvicorn calls this ten times a second."""
        # uvicorn updates Date in one of ten calls. A page that takes the time from it would be a second off.
        stops = await super().on_tick(counter - counter % DATE_TICKS)
        return stops or all(dispatcher.drained for dispatcher in self._dispatchers)

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Install no signal handlers: the event loop has its own."""
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start as uvicorn does, then call `serving`: connections are accepted now."""
        self._listeners = [] if sockets is None else sockets
        await super().startup(sockets)
        self._serving()


def make_server_config(
    app: FastAPI, access: Access, decoded: DecodeCache, has_streams: bool
) -> uvicorn.Config:
    """Make uvicorn's configuration for a port that strangers reach."""
    http = make_http_protocol(access, decoded) if has_streams else make_plain_http_protocol(access)
    return uvicorn.Config(
        app,
        ws=make_live_protocol(access, decoded) if has_streams else "none",
        http=http,
        lifespan="off",
        log_config=None,
        access_log=False,
        server_header=False,
        backlog=BACKLOG,
        timeout_graceful_shutdown=GRACE_S,
    )


def settle_memory() -> None:
    """Exclude all present objects from garbage collection, because they live as long as the process. Also
    collect less often: with Python's thresholds, thousands of connections cause pauses of 300 ms.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 100)


def _end() -> None:
    """End the process without waiting for library threads or DNS, before the platform kills it."""
    log.warning("some connections are still open %g s after the signal: exiting anyway", END_S)
    os._exit(0)
