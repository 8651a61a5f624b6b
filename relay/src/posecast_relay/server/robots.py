"""Reads the file of robots as a process of these settings may take it, and waits where it can't."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from functools import partial
from pathlib import Path

from posecast_relay.config.robots_file import read_robots
from posecast_relay.config.robots_reader import Robots, RobotsError
from posecast_relay.config.settings import Settings
from posecast_relay.zenoh.certificates import CertificateError, RouterCertificates

log = logging.getLogger("posecast_relay")

LOOK_S = 0.5


async def wait_for_robots(settings: Settings) -> Robots | None:
    """Read the file, and wait until it is good and so are the certificates; None without a file.

    A process that ended over a file would be started again and again. Nobody may publish or watch meanwhile,
    since nothing else is known.
    """
    said = ""
    while True:
        try:
            robots = load_robots(settings)
        except (RobotsError, CertificateError) as e:
            if str(e) != said:
                log.error("%s; nobody can publish or watch until this is fixed", e)
            said = str(e)
        else:
            if said:
                log.warning("the configuration is valid: starting")
            return robots
        await asyncio.sleep(LOOK_S)


def load_robots(settings: Settings) -> Robots | None:
    """Read the file, and look at the certificates; None without a file.

    Raises RobotsError and CertificateError.
    """
    if settings.robots is None:
        return None
    if settings.role != "gateway":
        RouterCertificates(settings.zenoh_tls_cert, settings.zenoh_tls_key, settings.zenoh_ca)
    return make_reader(settings)(settings.robots)


def make_reader(settings: Settings) -> Callable[[Path], Robots]:
    """Return what reads the file, and raises RobotsError. Without a store it refuses `keep`, as nothing would
    be kept; a gateway keeps nothing in any case.
    """
    return partial(read_robots, has_store=settings.archive is not None or settings.role == "gateway")
