"""Finds free ports: the default one, or the next free one after it."""

from __future__ import annotations

import errno
import socket

PAGE_PORT, ROBOTS_PORT = 8080, 7447
TRIES = 100


class PortError(Exception):
    """No port is free. The message is one line."""


def is_taken(host: str, port: int) -> bool:
    """Whether another program listens on this port of `host`, an address or a name."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as e:
            return e.errno == errno.EADDRINUSE  # the relay reports any other problem
    return False


def find_free_port(host: str, first: int) -> int:
    """The first free port from `first` on. Raises PortError when the first TRIES are in use."""
    for port in range(first, first + TRIES):
        if not is_taken(host, port):
            return port
    raise PortError(f"ports {first} to {first + TRIES - 1} of {host} are all in use")
