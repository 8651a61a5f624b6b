"""Runs one relay process: opens everything, serves, and closes everything."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import logging
import os
import resource
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Coroutine, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import uvicorn
import uvloop
import zenoh

from posecast_relay.auth.access import Access, open_access
from posecast_relay.auth.addresses import Addresses
from posecast_relay.auth.tokens import Accounts, Tokens
from posecast_relay.config.robots_file import Robots
from posecast_relay.config.robots_watcher import RobotsWatcher
from posecast_relay.config.settings import Settings, StartError
from posecast_relay.core.delayed_hub import DelayedHub
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.core.roster import Headcount
from posecast_relay.http.app import make_app
from posecast_relay.http.metrics import start_metrics
from posecast_relay.http.past.desk import PastDesk
from posecast_relay.logging import LoopExceptionHandler, start_logging
from posecast_relay.runtime.dispatcher import Dispatcher
from posecast_relay.runtime.fan_out import FanOut
from posecast_relay.runtime.io_uring import IoUring
from posecast_relay.server.listener import BACKLOG, listen
from posecast_relay.server.past import PastServices, is_store_new, make_past_services
from posecast_relay.server.past_log import describe_past
from posecast_relay.server.robots import load_robots, make_reader
from posecast_relay.server.roles import RoleServices, make_role_services
from posecast_relay.streaming.decode_cache import DecodeCache
from posecast_relay.streaming.http_connection import make_plain_http_protocol
from posecast_relay.streaming.request_timeouts import RequestTimeouts, add_timeouts
from posecast_relay.streaming.sse import make_http_protocol
from posecast_relay.streaming.websocket import make_live_protocol
from posecast_relay.zenoh.auth_failures import AuthFailures
from posecast_relay.zenoh.router import ListenError, RouterSession, ZenohAuth

if TYPE_CHECKING:
    from posecast_relay.mirror.firebase import FirebaseMirror

log = logging.getLogger("posecast_relay")

SWITCH_S = 0.0005  # the loop waits no longer for Zenoh's threads to let go of the interpreter (Python: 5 ms)
SPARE_FILES = 1000  # beside the viewers' sockets
GRACE_S = 2  # for requests under way when the relay stops
CLOSE_ZENOH_S = 1.0
END_S = 9.5  # after SIGTERM; platforms kill a process at 10 s


class _Server(uvicorn.Server):
    """uvicorn without its signal handlers, which close all connections at once and exit by the signal."""

    def __init__(
        self,
        config: uvicorn.Config,
        dispatchers: Sequence[Dispatcher],
        serving: Callable[[], None],
        desk: PastDesk | None,
    ) -> None:
        super().__init__(config)
        self._dispatchers = dispatchers
        self._desk = desk
        self._serving = serving

    def leave(self) -> None:
        """Move the viewers away, then stop; at once when called again. Called at SIGTERM and Ctrl-C."""
        going = self._dispatchers[0].draining
        self.force_exit = self.should_exit = going
        if not going:
            last = threading.Timer(END_S, _end)
            last.daemon = True
            last.start()
        if self._desk is not None:
            self._desk.held.release()
        for dispatcher in self._dispatchers:
            dispatcher.drain()

    async def on_tick(self, counter: int) -> bool:
        """Return whether to stop. uvicorn calls this ten times a second."""
        return await super().on_tick(counter) or all(dispatcher.drained for dispatcher in self._dispatchers)

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals alone: handlers of the event loop take them."""
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start as uvicorn does, then call `serving`, since connections are accepted now."""
        await super().startup(sockets)
        self._serving()


def run(settings: Settings) -> None:
    """Serve until SIGTERM or SIGINT. Raises StartError when something can't be opened, as a port in use."""
    sys.setswitchinterval(SWITCH_S)
    start_logging(settings.log_level)
    logging.getLogger("websockets").setLevel(logging.WARNING)  # else two lines for every viewer
    robots = load_robots(settings)
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.get_loop().set_exception_handler(LoopExceptionHandler())
        runner.run(_serve(settings, robots))


async def _serve(settings: Settings, robots: Robots | None) -> None:
    _allow_sockets(settings.max_viewers)
    listener = listen(settings.host, settings.port)
    try:
        router, refusals = _publishers(settings, robots)
    except ListenError as e:
        listener.close()
        raise StartError(str(e)) from None
    host, port = listener.getsockname()[:2]
    limits, headcount, past = _limits(settings), Headcount(), make_past_services(settings, port)
    hub = Hub(limits, headcount, None if past is None else past.recorder)
    delayed = None if robots is None else DelayedHub(limits, headcount)
    services = make_role_services(settings, router, hub, past, delayed.list_robots if delayed else tuple)
    access = _access(settings, robots, services, hub, delayed)
    dispatcher = access.live
    mirror = _mirror(settings, access)
    decoded, desk = DecodeCache(), None if past is None else past.make_desk(dispatcher)
    try:
        stop_metrics = _metrics(settings, access, mirror, refusals, past, desk)
    except OSError as e:
        listener.close()
        await _close(router)
        raise StartError(
            f"--metrics-port {settings.metrics_port}: {(e.strerror or str(e)).lower()}"
        ) from None
    streams = settings.role != "ingest"
    shown = f"[{host}]" if ":" in host else host
    source = f"on {', '.join(router.endpoints)}" if router else "from Redis"
    line = f"posecast-relay: serving http://{shown}:{port}, robots {source}"

    def serving() -> None:
        # What was made until here lives as long as the process: the collector need not walk it. Nor need it
        # walk thousands of new connections at every turn (pauses of 300 ms with Python's thresholds).
        gc.collect()
        gc.freeze()
        gc.set_threshold(50_000, 20, 100)
        print(line, describe_past(settings, access.policy, is_new=is_store_new(past)), sep="\n", flush=True)

    def cut(count: int) -> None:
        dispatcher.handshakes["never asked"] += count

    unasked = RequestTimeouts(dispatcher.now, cut)
    config = uvicorn.Config(
        make_app(
            access,
            services.models,
            decoded,
            settings.static,
            settings.public_url,
            _find_publish_at(settings, router),
            desk,
        ),
        ws=make_live_protocol(access, decoded) if streams else "none",
        http=add_timeouts(
            make_http_protocol(access, decoded) if streams else make_plain_http_protocol(access), unasked
        ),
        lifespan="off",
        log_config=None,
        access_log=False,
        server_header=False,
        backlog=BACKLOG,
        timeout_graceful_shutdown=GRACE_S,
    )
    server = _Server(config, access.dispatchers, serving, desk)
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, server.leave)
    await services.start(dispatcher)
    for each in access.dispatchers:
        each.start()
    beside = _beside(_follow(settings, robots, router, services, access), mirror, _run_past(past, access))
    try:
        await server.serve(sockets=[listener])
    finally:
        for each in access.dispatchers:
            each.stop()
        for task in beside:
            task.cancel()
        await _stop(services, past)
        stop_metrics()
        await _close(router)


def _find_publish_at(settings: Settings, router: RouterSession | None) -> str | None:
    """Return the endpoint that pages are told, with --dev only: elsewhere it takes a credential, and whoever
    gives that knows the endpoint.
    """
    tells = settings.dev and settings.role == "all"
    return router.endpoints[0] if router is not None and tells else None


def _limits(settings: Settings) -> Limits:
    return Limits(
        viewers=settings.max_viewers,
        per_address=settings.max_per_address,
        robots=settings.max_robots,
        view_frames_per_s=settings.max_view_frames,
        robot_messages_per_s=settings.max_robot_messages,
        robot_bytes_per_s=settings.max_robot_bytes,
        max_age_s=settings.max_connection_age or float("inf"),
    )


def _access(
    settings: Settings, robots: Robots | None, services: RoleServices, hub: Hub, delayed: DelayedHub | None
) -> Access:
    addresses = Addresses(settings.max_per_address, settings.trusted_proxies)
    ports = (hub, delayed, services.store, FanOut(_ring()), services.source)
    has_past = settings.past is not None
    if robots is None:
        return open_access(*ports, addresses=addresses, has_past=has_past)
    tokens = Tokens(_accounts(settings), robots.find_link_keys())
    return open_access(*ports, robots.make_policy(), tokens, settings.origins, addresses, has_past)


def _accounts(settings: Settings) -> Accounts | None:
    if settings.firebase_project is None:
        return None
    try:
        from posecast_relay.auth.firebase import Firebase  # noqa: PLC0415 — a second to load
    except ImportError:
        raise StartError("--firebase-project: install posecast-relay[firebase]") from None
    return Firebase(settings.firebase_project, settings.firebase_revoked)


def _publishers(
    settings: Settings, robots: Robots | None
) -> tuple[RouterSession | None, AuthFailures | None]:
    """Open the session that edges connect to, and what counts those that it refuses. Raises ListenError."""
    router: RouterSession | None = None
    refusals: AuthFailures | None = None
    if robots is not None and not settings.dev and settings.role != "gateway":
        refusals = AuthFailures(lambda robot: router is None or router.lets_in(robot))
    router = _router(settings, robots)
    return router, refusals


def _router(settings: Settings, robots: Robots | None) -> RouterSession | None:
    """Open the session that edges connect to; None for a gateway, which hears none. Raises ListenError."""
    if settings.role == "gateway":
        return None
    if settings.dev or robots is None:
        zenoh.init_log_from_env_or("off")
        return RouterSession(settings.zenoh_listen, None)
    admitted = _admitted(settings, robots)
    auth = ZenohAuth(admitted, settings.zenoh_tls_cert, settings.zenoh_tls_key, settings.zenoh_ca)
    return RouterSession(settings.zenoh_listen, auth)


def _beside(
    following: Coroutine[Any, Any, None] | None,
    mirror: FirebaseMirror | None,
    past: Coroutine[Any, Any, None] | None,
) -> list[asyncio.Task[None]]:
    """Start the tasks that run while the relay serves."""
    mirroring = None if mirror is None else mirror.run()
    named = {"robots file": following, "mirror": mirroring, "past": past}
    return [asyncio.create_task(work, name=name) for name, work in named.items() if work is not None]


async def _stop(services: RoleServices, past: PastServices | None) -> None:
    if past is not None:
        await past.stop(Dispatcher.now())
    await services.stop()


def _run_past(past: PastServices | None, access: Access) -> Coroutine[Any, Any, None] | None:
    """Return what the past does while the relay serves; None where there is none."""
    return None if past is None else past.run(access, Dispatcher.now)


def _admitted(settings: Settings, robots: Robots) -> dict[str, str]:
    """Return the password of each robot that may publish now; '' where a certificate is asked for."""
    now_s = time.time()
    return (
        robots.find_secrets(now_s)
        if settings.zenoh_ca is None
        else dict.fromkeys(robots.list_publishers(now_s), "")
    )


def _follow(
    settings: Settings,
    robots: Robots | None,
    router: RouterSession | None,
    services: RoleServices,
    access: Access,
) -> Coroutine[Any, Any, None] | None:
    """Return what follows the file of robots while the relay serves; None without a file."""
    if settings.robots is None or robots is None:
        return None

    async def changed(to: Robots) -> None:
        if access.tokens is not None:
            access.tokens.set_link_keys(to.find_link_keys())
        access.set_policy(to.make_policy())
        if router is not None:
            await services.admit(_admitted(settings, to))

    watch = RobotsWatcher(settings.robots, robots, changed, make_reader(settings))

    async def follow() -> None:
        await asyncio.gather(watch.run(), access.recheck_accounts())

    return follow()


def _ring() -> IoUring | None:
    ring = IoUring.open()
    log.info("frames go out %s", "by io_uring" if ring else "one write() each: io_uring is not allowed here")
    return ring


def _end() -> None:
    """End the process: what is still waited for (a library's thread, a name server) is not worth a kill."""
    log.warning("not all is closed %g s after the signal: ending as it is", END_S)
    os._exit(0)


def _allow_sockets(viewers: int) -> None:
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


def _mirror(settings: Settings, access: Access) -> FirebaseMirror | None:
    if settings.firebase_database is None:
        return None
    credentials = os.environ.get("GOOGLE_APPLICATION_CREDENTIALS")
    if credentials and not os.access(credentials, os.R_OK):
        raise StartError(f"GOOGLE_APPLICATION_CREDENTIALS {credentials!r}: can't be read")
    try:
        from posecast_relay.mirror.firebase import FirebaseMirror  # noqa: PLC0415 — seldom wanted
    except ImportError:
        raise StartError("--firebase-database: install posecast-relay[firebase]") from None
    return FirebaseMirror(settings.firebase_database, access)


def _metrics(
    settings: Settings,
    access: Access,
    mirror: FirebaseMirror | None,
    refusals: AuthFailures | None,
    past: PastServices | None,
    desk: PastDesk | None,
) -> Callable[[], None]:
    if settings.metrics_port is None:
        return lambda: None
    refused = int if refusals is None else lambda: refusals.count
    kept, way, archive = (None, None, None) if past is None else (past.kept, past.way, past.written_archive)
    held = None if desk is None else desk.held
    port, stop = start_metrics(
        settings.host, settings.metrics_port, access.dispatchers, mirror, refused, kept, way, held, archive
    )
    log.info("metrics on http://%s:%d/metrics", settings.host, port)
    return stop


async def _close(router: RouterSession | None) -> None:
    """Close Zenoh's session, but wait for CLOSE_ZENOH_S at most: a peer may never answer."""
    if router is None:
        return
    closing = threading.Thread(target=router.session.close, daemon=True)
    closing.start()
    give_up_at = asyncio.get_running_loop().time() + CLOSE_ZENOH_S
    while closing.is_alive() and asyncio.get_running_loop().time() < give_up_at:
        await asyncio.sleep(0.01)
