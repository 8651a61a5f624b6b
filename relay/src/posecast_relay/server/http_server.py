"""The HTTP server of a process: uvicorn, which moves viewers away before it stops."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import logging
import os
import signal
import socket
import threading
from collections.abc import Callable, Iterator, Sequence

import uvicorn
from fastapi import FastAPI

from posecast_relay.auth.access import Access
from posecast_relay.runtime.dispatcher import Dispatcher
from posecast_relay.server.listener import BACKLOG
from posecast_relay.streaming.decode_cache import DecodeCache
from posecast_relay.streaming.http_connection import HttpConnection, make_plain_http_protocol
from posecast_relay.streaming.request_timeouts import RequestTimeouts, add_timeouts
from posecast_relay.streaming.sse import make_http_protocol
from posecast_relay.streaming.websocket import make_live_protocol

log = logging.getLogger("posecast_relay")

GRACE_S = 2  # for requests under way when the relay stops
DATE_TICKS = 10  # calls of on_tick from one Date of uvicorn's to the next
END_S = 9.5  # after SIGTERM; platforms kill a process at 10 s


class RelayServer(uvicorn.Server):
    """uvicorn without its signal handlers, which close all connections at once and exit by the signal."""

    def __init__(
        self,
        config: uvicorn.Config,
        dispatchers: Sequence[Dispatcher],
        serving: Callable[[], None],
    ) -> None:
        """`serving` is called when connections are accepted."""
        super().__init__(config)
        self._dispatchers = dispatchers
        self._serving = serving
        self._listeners: list[socket.socket] = []
        self._leaving: list[Callable[[], None]] = []
        self._may_end: Callable[[], bool] = lambda: True

    def before_leaving(self, call: Callable[[], None]) -> None:
        """Call this when the relay begins to stop, before viewers are moved away."""
        self._leaving.append(call)

    def end_after(self, may_end: Callable[[], bool]) -> None:
        """Go on serving, all viewers moved away, until `may_end` says so."""
        self._may_end = may_end

    def obey_signals(self) -> None:
        """Leave at SIGTERM and at Ctrl-C."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(number, self.leave)

    def leave(self) -> None:
        """Move the viewers away, then stop; at once when called again."""
        going = self._dispatchers[0].draining
        self.force_exit = self.should_exit = going
        if not going:
            last = threading.Timer(END_S, _end)
            last.daemon = True
            last.start()
            for call in self._leaving:
                call()
            self._take_no_more()
        for dispatcher in self._dispatchers:
            dispatcher.drain()

    def _take_no_more(self) -> None:
        """Accept no connection from now on, and close those on which nothing is asked just now.

        A proxy that finds the port closed asks another relay at once; whoever is let in only to be told to go
        comes back to the proxy, which knows no better than before.
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
        # Of ten calls one makes its Date anew. A page that reckons the time by that would be a second off.
        stops = await super().on_tick(counter - counter % DATE_TICKS)
        return stops or (all(dispatcher.drained for dispatcher in self._dispatchers) and self._may_end())

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals alone: handlers of the event loop take them."""
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start as uvicorn does, then call `serving`, since connections are accepted now."""
        self._listeners = [] if sockets is None else sockets
        await super().startup(sockets)
        self._serving()


def make_server_config(
    app: FastAPI | Callable[..., object], access: Access, decoded: DecodeCache, has_streams: bool = True
) -> uvicorn.Config:
    """Make uvicorn's configuration for a port that strangers reach."""

    def cut(count: int) -> None:
        access.live.handshakes["never asked"] += count

    unasked = RequestTimeouts(access.live.now, cut)
    http = make_http_protocol(access, decoded) if has_streams else make_plain_http_protocol(access)
    return uvicorn.Config(
        app,
        ws=make_live_protocol(access, decoded) if has_streams else "none",
        http=add_timeouts(http, unasked),
        lifespan="off",
        log_config=None,
        access_log=False,
        server_header=False,
        backlog=BACKLOG,
        timeout_graceful_shutdown=GRACE_S,
    )


def settle_memory() -> None:
    """Spare the collector what was made so far, since it lives as long as the process; nor need it walk
    thousands of new connections at every turn (pauses of 300 ms with Python's thresholds).
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 100)


def _end() -> None:
    """End the process: what is still waited for (a library's thread, a name server) is not worth a kill."""
    log.warning("some connections are still open %g s after the signal: exiting anyway", END_S)
    os._exit(0)
