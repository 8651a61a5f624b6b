"""Ports for programs that must be told one. Whoever can asks for port 0 and reads what it got."""

from __future__ import annotations

import itertools
import os
import random
import socket
from collections.abc import Iterator

# below the ports that Linux gives out by itself, so that nobody who asked for port 0 gets one of these
_FIRST, _LAST = 10_000, 32_000
_WORKERS = 10  # of pytest-xdist; each has ports of its own


def _choose_ports() -> Iterator[int]:
    """All ports of this process's worker, from a random one on, again and again."""
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:]) % _WORKERS
    size = (_LAST - _FIRST) // _WORKERS
    for i in itertools.count(random.randrange(size)):
        yield _FIRST + worker * size + i % size


_ports = _choose_ports()


def free_port() -> int:
    """Return a TCP port of 127.0.0.1 that nobody listens on, and that no parallel test is given."""
    for port in _ports:
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port
    raise AssertionError


def is_listened_on(port: int) -> bool:
    """Whether somebody accepts connections at this TCP port of 127.0.0.1."""
    with socket.socket() as probe:
        probe.settimeout(1.0)
        return probe.connect_ex(("127.0.0.1", port)) == 0
