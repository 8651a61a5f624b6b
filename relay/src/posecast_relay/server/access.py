"""Makes a process's access control from its settings and the robots file: waits until that file is valid, and
watches it.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path

from posecast_wire.command_line.installation import advise_extra

from posecast_relay.auth.access import Access, open_access
from posecast_relay.auth.addresses import Addresses
from posecast_relay.auth.tokens import Accounts, Tokens
from posecast_relay.config.robots_file import RobotsWatcher, read_robots
from posecast_relay.config.robots_reader import Robots, RobotsError
from posecast_relay.config.settings import Settings, StartError
from posecast_relay.core.delayed import DelayedHub
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.runtime.dispatcher import RobotSource, StateStore
from posecast_relay.runtime.fan_out import FanOut, IoUring
from posecast_relay.zenoh.router import CertificateError, RouterCertificates

log = logging.getLogger("posecast_relay")

LOOK_S = 0.5


def check_store(settings: Settings) -> None:
    """Raise StartError if all that is wrong with the file is that it needs an object store: a flag can't be
    corrected while the process waits.
    """
    if settings.robots is None:
        return
    try:
        make_reader(settings)(settings.robots)
    except RobotsError as e:
        with contextlib.suppress(RobotsError):
            read_robots(settings.robots)
            raise StartError(str(e)) from None


async def wait_for_robots(settings: Settings) -> Robots | None:
    """Read the file; wait until it and the certificates are valid. Return None without a file.

    If the process exited instead, it would be restarted again and again. Until the file is valid, nobody can
    publish or watch.
    """
    reported = ""
    while True:
        try:
            robots = load_robots(settings)
        except (RobotsError, CertificateError) as e:
            if str(e) != reported:
                is_missing = settings.robots is not None and not settings.robots.exists()
                hint = f" (`posecast-relay robots add --robots {settings.robots} ID` makes it)"
                log.error(
                    "%s; nobody can publish or watch until this is fixed", f"{e}{hint if is_missing else ''}"
                )
            reported = str(e)
        else:
            if reported:
                log.warning("the configuration is valid: starting")
            return robots
        await asyncio.sleep(LOOK_S)


def load_robots(settings: Settings) -> Robots | None:
    """Read the file and check the certificates; None without a file.

    Raises RobotsError and CertificateError.
    """
    if settings.robots is None:
        return None
    if settings.role != "gateway":
        RouterCertificates(settings.zenoh_tls_cert, settings.zenoh_tls_key, settings.zenoh_ca)
    return make_reader(settings)(settings.robots)


def make_reader(settings: Settings) -> Callable[[Path], Robots]:
    """Return a function that reads the file and raises RobotsError. It refuses `keep` if the relay has no
    object store. A gateway accepts it, because it stores nothing anyway.
    """
    return partial(read_robots, has_store=settings.archive is not None or settings.role == "gateway")


def make_limits(settings: Settings) -> Limits:
    """Make the core's limits."""
    return Limits(
        viewers=settings.max_viewers,
        per_address=settings.max_per_address,
        robots=settings.max_robots,
        view_frames_per_s=settings.max_view_frames,
        robot_messages_per_s=settings.max_robot_messages,
        robot_bytes_per_s=settings.max_robot_bytes,
        max_age_s=settings.max_connection_age or float("inf"),
    )


def make_access(
    settings: Settings,
    robots: Robots | None,
    ports: tuple[StateStore, RobotSource],
    hub: Hub,
    delayed: DelayedHub | None,
) -> Access:
    """Make the access control of a process. Raises StartError if accounts can't be verified."""
    store, source = ports
    addresses = Addresses(settings.max_per_address, settings.trusted_proxies)
    given = (hub, delayed, store, FanOut(_open_ring(settings)), source)
    has_past = settings.past is not None
    if robots is None:
        return open_access(*given, addresses=addresses, has_past=has_past)
    tokens = Tokens(_accounts(settings), robots.find_link_keys())
    return open_access(*given, robots.make_policy(), tokens, settings.origins, addresses, has_past)


def make_watcher(
    settings: Settings,
    robots: Robots | None,
    access: Access,
    admit: Callable[[Robots], Awaitable[None]] | None,
) -> RobotsWatcher | None:
    """Make the watcher of the robots file and the certificates; None without that file.

    `admit`: lets robots publish; None in a process to which no robots connect.
    """
    if settings.robots is None or robots is None:
        return None

    async def changed(to: Robots) -> None:
        if access.tokens is not None:
            access.tokens.set_link_keys(to.find_link_keys())
        access.set_policy(to.make_policy())
        if admit is not None:
            await admit(to)

    given = (settings.zenoh_tls_cert, settings.zenoh_tls_key, settings.zenoh_ca)
    certificates = [path for path in given if path is not None and admit is not None]
    return RobotsWatcher(settings.robots, robots, changed, make_reader(settings), certificates)


async def follow_robots(watch: RobotsWatcher | None, access: Access) -> None:
    """Watch the robots file until cancelled; return at once without one."""
    if watch is not None:
        await asyncio.gather(watch.run(), access.recheck_accounts())


def _accounts(settings: Settings) -> Accounts | None:
    if settings.firebase_project is None:
        return None
    try:
        from posecast_relay.auth.firebase import Firebase  # noqa: PLC0415 — a second to load
    except ImportError:
        raise StartError(f"--firebase-project: {advise_extra('posecast-relay', 'firebase')}") from None
    return Firebase(settings.firebase_project, settings.firebase_revoked)


def _open_ring(settings: Settings) -> IoUring | None:
    ring = IoUring.open()
    if ring is None:
        log.log(
            logging.INFO if settings.dev else logging.WARNING,  # --dev: nobody plans a crowd
            "io_uring is not allowed here: plan for 1,900 viewers per core at 30 Hz instead of 2,400",
        )
    return ring
