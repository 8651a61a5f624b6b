"""Runs one relay process: opens everything, serves, and closes everything.

While it waits for a valid configuration, it answers HTTP: alive, but not ready. While it runs, it reports
whether its configuration files are valid and in force.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import os
import socket
import sys
import time
from collections.abc import Callable, Coroutine, Mapping
from typing import TYPE_CHECKING, Any

import uvloop
import zenoh
from posecast_wire.command_line.installation import advise_extra

from posecast_relay.auth.access import Access
from posecast_relay.config.robots_file import RobotsWatcher
from posecast_relay.config.robots_reader import Robots
from posecast_relay.config.settings import Settings, StartError, find_page
from posecast_relay.core.delayed import DelayedHub
from posecast_relay.core.hub import Headcount, Hub
from posecast_relay.http.admin.routes import AdminSources
from posecast_relay.http.app import make_app
from posecast_relay.http.metrics import RelayCollector, start_metrics
from posecast_relay.logging import LoopExceptionHandler, start_logging
from posecast_relay.net.encodings import DecodeCache
from posecast_relay.past.service import PastService
from posecast_relay.runtime.dispatcher import Dispatcher
from posecast_relay.runtime.port_holder import explain_taken
from posecast_relay.server.access import (
    check_store,
    follow_robots,
    make_access,
    make_limits,
    make_watcher,
    wait_for_robots,
)
from posecast_relay.server.http_server import (
    RelayServer,
    allow_sockets,
    listen,
    make_server_config,
    settle_memory,
)
from posecast_relay.server.past import PastServices, describe_past, make_past_services
from posecast_relay.server.roles import make_role_services
from posecast_relay.zenoh.router import (
    AuthFailures,
    CertificateError,
    ListenError,
    RouterSession,
    ZenohAuth,
    close_session,
)

if TYPE_CHECKING:
    from posecast_relay.mirror.firebase import FirebaseMirror

log = logging.getLogger("posecast_relay")

NOT_READY = "the robots file or a certificate is invalid or can't be read; the log says which"
HEAD_BYTES_MAX = 1 << 14
HEAD_S = 5.0
CONNECTIONS_MAX = 100  # further ones are closed at once


class WaitingServer:
    """An async context manager that serves on a listening socket. The socket stays open afterwards.

    `/livez` answers 200, so that no platform restarts the process. `/readyz` and everything else answer 503.
    """

    def __init__(self, listener: socket.socket) -> None:
        self._listener = listener
        self._server: asyncio.Server | None = None
        self._open: set[asyncio.StreamWriter] = set()

    async def __aenter__(self) -> WaitingServer:
        """Start to serve."""
        self._server = await asyncio.start_server(
            self._answer, sock=self._listener.dup(), limit=HEAD_BYTES_MAX
        )
        return self

    async def __aexit__(self, *_error: object) -> None:
        """Close all connections."""
        assert self._server is not None
        self._server.close()
        for writer in tuple(self._open):
            writer.close()

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._open) < CONNECTIONS_MAX:
            self._open.add(writer)
            # a client that sends no request, or has left, gets no answer
            with contextlib.suppress(TimeoutError, OSError, asyncio.IncompleteReadError, ValueError):
                async with asyncio.timeout(HEAD_S):
                    await self._exchange(reader, writer)
            self._open.discard(writer)
        writer.close()

    async def _exchange(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            head = await reader.readuntil(b"\r\n\r\n")
        except asyncio.LimitOverrunError:
            return
        target = head.partition(b"\r\n")[0].split(b" ")[1:2]
        if target == [b"/livez"]:
            status, kind, body = "200 OK", "text/plain", b"ok\n"
        elif target == [b"/readyz"]:
            status, kind, body = (
                "503 Service Unavailable",
                "application/json",
                _pack(status="waiting", why=NOT_READY),
            )
        else:
            status, kind, body = "503 Service Unavailable", "application/json", _pack(error="not ready yet")
        writer.write(
            f"HTTP/1.1 {status}\r\ncontent-type: {kind}\r\ncontent-length: {len(body)}\r\n"
            "retry-after: 5\r\ncache-control: no-store\r\nconnection: close\r\n\r\n".encode()
            + body
        )
        await writer.drain()


def _pack(**doc: str) -> bytes:
    return json.dumps(doc).encode()


class Configuration:
    """The configuration files that one process watches, and their problems. Its methods are thread-safe."""

    def __init__(self, watch: RobotsWatcher | None, router: RouterSession | None) -> None:
        """`watch`: None without a robots file; `router`: None if no robots connect to this process."""
        self._watch, self._router = watch, router

    def find_trouble(self) -> str | None:
        """Return why robots can't connect, and which files can't be used; None if all is well. It is public,
        so it names no robot.
        """
        found = [
            f"the {what} file can't be used, so its last good version stays in force; the log says why"
            for what, of in (("robots", self._watch), ("certificates", self._router))
            if of is not None and of.trouble is not None
        ]
        if not self.is_listening():
            found.append(
                "robots can't connect, because their port can't be opened; retrying; the log says why"
            )
        elif self._watch is not None and self._watch.failure is not None:
            found.append("a change of the robots or certificates is not in force; retrying; the log says why")
        return "; ".join(found) or None

    def measure(self) -> dict[str, int]:
        """Return 1 for each kind of file that is valid and in force, 0 for one that is not."""
        if self._watch is None:
            return {}
        # without a port for robots, nobody publishes by the previous version: `is_listening` reports that
        is_in_force = self._watch.failure is None or not self.is_listening()
        found = {"robots": int(self._watch.trouble is None and is_in_force)}
        if self._router is not None:
            found["certificates"] = int(self._router.trouble is None)
        return found

    def is_listening(self) -> bool:
        """Return whether robots can connect. A process to which none connect returns True."""
        return self._router is None or self._router.is_listening

    def find_expiries(self) -> Mapping[str, float]:
        """Return when the certificates in use expire, in unix seconds, by the flag that names the file."""
        return {} if self._router is None else self._router.expiries_s


SWITCH_S = 0.0005  # how long the loop waits for Zenoh's threads to release the GIL (Python's default: 5 ms)
CLOSE_ZENOH_S = 1.0


def run(settings: Settings) -> None:
    """Serve until SIGTERM or SIGINT. Raises StartError if something can't be opened (a port in use)."""
    sys.setswitchinterval(SWITCH_S)
    start_logging(settings.log_level)
    logging.getLogger("websockets").setLevel(logging.WARNING)  # otherwise it logs two lines for every viewer
    check_store(settings)
    allow_sockets(settings.max_viewers)
    with (
        listen(settings.host, settings.port) as listener,
        asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner,
    ):
        runner.get_loop().set_exception_handler(LoopExceptionHandler())
        runner.run(_serve(settings, listener))


async def _serve(settings: Settings, listener: socket.socket) -> None:
    async with WaitingServer(listener):  # until the robots file is valid
        robots = await wait_for_robots(settings)
    router, refusals = _open_router_and_refusals(settings, robots)
    port = listener.getsockname()[1]
    limits, headcount, past = make_limits(settings), Headcount(), make_past_services(settings, port)
    hub = Hub(limits, headcount, past.recorder)
    delayed = None if robots is None else DelayedHub(limits, headcount)
    services = make_role_services(settings, router, hub, past, delayed.list_robots if delayed else tuple)
    access = make_access(settings, robots, (services.store, services.source), hub, delayed)
    dispatcher = access.live
    admit = None if router is None else lambda to: services.admit(_list_admitted(settings, to))
    watch = make_watcher(settings, robots, access, admit)
    configuration = Configuration(watch, router)
    mirror = _mirror(settings, access)
    decoded, service = DecodeCache(), past.make_service(dispatcher)
    try:
        stop_metrics = _metrics(settings, access, mirror, refusals, past, service, configuration)
    except StartError:
        await _close(router)
        raise

    def serving() -> None:
        settle_memory()
        _tell(listener, router, describe_past(settings, access.policy, is_new=past.is_store_new))

    def leaving() -> None:
        if service is not None:
            service.held.release()

    app = make_app(
        access,
        services.models,
        decoded,
        settings.static or find_page(),
        settings.public_url,
        _find_publish_at(settings, router),
        service,
        configuration.find_trouble,
        _make_admin(settings, watch, configuration, refusals, past),
    )
    config = make_server_config(app, access, decoded, has_streams=settings.role != "ingest")
    server = RelayServer(config, access.dispatchers, serving, leaving)
    server.obey_signals()
    await services.start(dispatcher)
    for each in access.dispatchers:
        each.start()
    beside = _start_background_tasks(follow_robots(watch, access), mirror, past.run(access, Dispatcher.now))
    try:
        await server.serve(sockets=[listener])
    finally:
        for each in access.dispatchers:
            each.stop()
        for task in beside:
            task.cancel()
        await past.stop(Dispatcher.now())
        await services.stop()
        stop_metrics()
        await _close(router)


def _tell(listener: socket.socket, router: RouterSession | None, past: str) -> None:
    """Print the addresses of this relay."""
    host, port = listener.getsockname()[:2]
    shown = f"[{host}]" if ":" in host else host
    source = f"on {', '.join(router.endpoints)}" if router else "from Redis"
    print(f"posecast-relay: serving http://{shown}:{port}, robots {source}", past, sep="\n", flush=True)


def _make_admin(
    settings: Settings,
    watch: RobotsWatcher | None,
    configuration: Configuration,
    refusals: AuthFailures | None,
    past: PastServices,
) -> AdminSources | None:
    """Return the data sources of the page /admin; None without a robots file."""
    if settings.robots is None or watch is None:
        return None
    return AdminSources(
        settings.robots,
        lambda: watch.robots,
        configuration.find_expiries,
        int if refusals is None else lambda: refusals.count,
        past.kept,
        past.written_archive,
        settings.public_url,
    )


def _find_publish_at(settings: Settings, router: RouterSession | None) -> str | None:
    """Return the endpoint that the API shows to pages. Only with --dev: otherwise robots need a credential,
    and whoever makes that knows the endpoint.
    """
    tells = settings.dev and settings.role == "all"
    return router.endpoints[0] if router is not None and tells else None


def _open_router_and_refusals(
    settings: Settings, robots: Robots | None
) -> tuple[RouterSession | None, AuthFailures | None]:
    """Open the session to which robots connect, and the counter of refused ones. Raises StartError."""
    router: RouterSession | None = None
    refusals: AuthFailures | None = None
    if robots is not None and not settings.dev and settings.role != "gateway":
        by_name = None if settings.zenoh_ca is None else lambda robot: router is None or router.lets_in(robot)
        refusals = AuthFailures(by_name)
    try:
        router = _open_router(settings, robots)
    except (ListenError, CertificateError) as e:
        raise StartError(str(e)) from None
    return router, refusals


def _open_router(settings: Settings, robots: Robots | None) -> RouterSession | None:
    """Open the session to which robots connect; None for a gateway, which has none. Raises ListenError."""
    if settings.role == "gateway":
        return None
    if settings.dev or robots is None:
        zenoh.init_log_from_env_or("off")
        return RouterSession(settings.zenoh_listen, None)
    admitted = _list_admitted(settings, robots)
    auth = ZenohAuth(admitted, settings.zenoh_tls_cert, settings.zenoh_tls_key, settings.zenoh_ca)
    return RouterSession(settings.zenoh_listen, auth)


def _start_background_tasks(
    following: Coroutine[Any, Any, None],
    mirror: FirebaseMirror | None,
    past: Coroutine[Any, Any, None],
) -> list[asyncio.Task[None]]:
    """Start the tasks that run while the relay serves."""
    mirroring = None if mirror is None else mirror.run()
    named = {"robots file": following, "mirror": mirroring, "past": past}
    return [asyncio.create_task(work, name=name) for name, work in named.items() if work is not None]


def _list_admitted(settings: Settings, robots: Robots) -> dict[str, str]:
    """Return the password of each robot that may publish now; '' if robots use certificates."""
    now_s = time.time()
    return (
        robots.find_secrets(now_s)
        if settings.zenoh_ca is None
        else dict.fromkeys(robots.list_publishers(now_s), "")
    )


def _mirror(settings: Settings, access: Access) -> FirebaseMirror | None:
    if settings.firebase_database is None:
        return None
    credentials = os.environ.get("GOOGLE_APPLICATION_CREDENTIALS")
    if credentials and not os.access(credentials, os.R_OK):
        raise StartError(f"GOOGLE_APPLICATION_CREDENTIALS {credentials!r}: can't be read")
    try:
        from posecast_relay.mirror.firebase import FirebaseMirror  # noqa: PLC0415 — seldom needed
    except ImportError:
        raise StartError(f"--firebase-database: {advise_extra('posecast-relay', 'firebase')}") from None
    return FirebaseMirror(settings.firebase_database, access)


def _metrics(
    settings: Settings,
    access: Access,
    mirror: FirebaseMirror | None,
    refusals: AuthFailures | None,
    past: PastServices,
    service: PastService | None,
    configuration: Configuration,
) -> Callable[[], None]:
    if settings.metrics_port is None:
        return lambda: None
    refused = int if refusals is None else lambda: refusals.count
    collector = RelayCollector(
        access.dispatchers,
        mirror,
        refused,
        past.kept,
        past.connection,
        None if service is None else service.held,
        past.written_archive,
        configuration.measure,
        configuration.find_expiries,
        configuration.is_listening,
    )
    try:
        port, stop = start_metrics(settings.host, settings.metrics_port, collector)
    except OSError as e:
        why = explain_taken(e, settings.metrics_port)
        raise StartError(f"--metrics-port {settings.metrics_port}: {why}") from None
    log.info("metrics on http://%s:%d/metrics", settings.host, port)
    return stop


async def _close(router: RouterSession | None) -> None:
    """Close Zenoh's session; wait at most CLOSE_ZENOH_S, because a peer may never answer."""
    if router is None:
        return
    closing = close_session(router.session)
    give_up_at = asyncio.get_running_loop().time() + CLOSE_ZENOH_S
    while closing.is_alive() and asyncio.get_running_loop().time() < give_up_at:
        await asyncio.sleep(0.01)
