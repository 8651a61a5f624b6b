"""One relay process from its first socket to its last: opens everything, serves, closes everything."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import logging
import resource
import signal
import socket
import threading
from collections.abc import Callable, Iterator

import uvicorn
import uvloop
import zenoh

from posecast_relay.adapters.decoded import Decoded
from posecast_relay.adapters.metrics import start_metrics
from posecast_relay.adapters.pump import Pump
from posecast_relay.adapters.sse import http_protocol
from posecast_relay.adapters.store_memory import MemoryStore
from posecast_relay.adapters.websocket import live_protocol
from posecast_relay.adapters.zenoh_session import ListenError, open_router
from posecast_relay.app import make_app
from posecast_relay.config import Settings
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.logs import start_logging
from posecast_relay.roles import open_part

log = logging.getLogger("posecast_relay")

SPARE_FILES = 1000  # beside the viewers' sockets
BACKLOG = 4096  # a lecture hall opens the link at once
GRACE_S = 2  # for requests under way when the relay stops
CLOSE_ZENOH_S = 1.0


class StartError(RuntimeError):
    """The relay cannot start: one line that says why."""


class _Server(uvicorn.Server):
    """uvicorn without its signal handlers: they close everybody at once, with the signal as status."""

    def __init__(self, config: uvicorn.Config, pump: Pump, serving: Callable[[], None]) -> None:
        super().__init__(config)
        self._pump = pump
        self._serving = serving

    def leave(self) -> None:
        """SIGTERM or Ctrl-C: move the viewers away, then stop. A second one: at once."""
        self.force_exit = self.should_exit = self._pump.draining
        self._pump.drain()

    async def on_tick(self, counter: int) -> bool:
        """Ten times a second: whether to stop."""
        return await super().on_tick(counter) or self._pump.drained

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Signals are the loop's."""
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Say so when connections are accepted."""
        await super().startup(sockets)
        self._serving()


def run(settings: Settings) -> None:
    """Serve until SIGTERM or SIGINT. StartError when a port is in use."""
    start_logging(settings.log_level)
    logging.getLogger("websockets").setLevel(logging.WARNING)  # else two lines for every viewer
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(_serve(settings))


async def _serve(settings: Settings) -> None:
    _allow_sockets(settings.max_viewers)
    listener = _bind(settings.host, settings.port)
    session: zenoh.Session | None = None
    source = "from Redis"
    if settings.role != "gateway":
        try:
            session, endpoints = open_router(settings.zenoh_listen)
        except ListenError as e:
            listener.close()
            raise StartError(str(e)) from None
        source = "on " + ", ".join(endpoints)
    limits = Limits(
        viewers=settings.max_viewers,
        robots=settings.max_robots,
        max_age_s=settings.max_connection_age or float("inf"),
    )
    pump = Pump(Hub(limits), MemoryStore())
    part = open_part(settings, session, pump)
    try:
        stop_metrics = _metrics(settings, pump)
    except OSError as e:
        listener.close()
        await _close(session)
        raise StartError(
            f"--metrics-port {settings.metrics_port}: {(e.strerror or str(e)).lower()}"
        ) from None
    decoded = Decoded()
    streams = settings.role != "ingest"
    host, port = listener.getsockname()[:2]
    shown = f"[{host}]" if ":" in host else host
    line = f"posecast-relay: serving http://{shown}:{port}, robots {source}"

    def serving() -> None:
        # What was made until here lives as long as the process: the collector need not walk it. Nor need it
        # walk thousands of new connections at every turn (pauses of 300 ms with Python's thresholds).
        gc.collect()
        gc.freeze()
        gc.set_threshold(50_000, 20, 100)
        print(line, flush=True)

    config = uvicorn.Config(
        make_app(pump, part.models, decoded, settings.static),
        ws=live_protocol(pump, decoded) if streams else "none",
        http=http_protocol(pump, decoded) if streams else "httptools",
        lifespan="off",
        log_config=None,
        access_log=False,
        server_header=False,
        backlog=BACKLOG,
        timeout_graceful_shutdown=GRACE_S,
    )
    server = _Server(config, pump, serving)
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, server.leave)
    await part.start()
    pump.start()
    try:
        await server.serve(sockets=[listener])
    finally:
        pump.stop()
        await part.stop()
        stop_metrics()
        await _close(session)


def _allow_sockets(viewers: int) -> None:
    """A socket per viewer: more than the 1,024 open files that shells usually allow, less than they may."""
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


def _bind(host: str, port: int) -> socket.socket:
    try:
        family, kind, proto, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.socket(family, kind, proto)
    except OSError as e:
        raise StartError(f"--host {host}: {e.strerror}") from None
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind(address)
        listener.listen(BACKLOG)
    except OSError as e:
        listener.close()
        raise StartError(f"http://{host}:{port}: {(e.strerror or str(e)).lower()}") from None
    return listener


def _metrics(settings: Settings, pump: Pump) -> Callable[[], None]:
    if settings.metrics_port is None:
        return lambda: None
    port, stop = start_metrics(settings.host, settings.metrics_port, pump)
    log.info("metrics on http://%s:%d/metrics", settings.host, port)
    return stop


async def _close(session: zenoh.Session | None) -> None:
    """Zenoh's close may wait for a peer that does not answer; the process need not."""
    if session is None:
        return
    closing = threading.Thread(target=session.close, daemon=True)
    closing.start()
    give_up_at = asyncio.get_running_loop().time() + CLOSE_ZENOH_S
    while closing.is_alive() and asyncio.get_running_loop().time() < give_up_at:
        await asyncio.sleep(0.01)
