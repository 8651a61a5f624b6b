"""Reads the robots file for a process with these settings, and waits until it is valid."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable
from functools import partial
from pathlib import Path

from posecast_relay.config.robots_file import read_robots
from posecast_relay.config.robots_reader import Robots, RobotsError
from posecast_relay.config.settings import Settings, StartError
from posecast_relay.zenoh.certificates import CertificateError, RouterCertificates

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
