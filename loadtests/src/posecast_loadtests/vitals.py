"""Reads the resources of a process from Linux, and the memory use of Redis from Redis."""

from __future__ import annotations

import os
import re
import socket
import urllib.request
from pathlib import Path
from typing import NamedTuple

_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
_ANSWER_S = 10.0


class Vitals(NamedTuple):
    """The resources of one process at one time."""

    rss_mb: float  # resident, 10⁶ bytes
    descriptors: int
    threads: int


def vitals(pid: int) -> Vitals:
    """Read a process. Raises FileNotFoundError or ProcessLookupError if it is gone."""
    at = Path(f"/proc/{pid}")
    pages = int((at / "statm").read_text().split()[1])
    threads = len(os.listdir(at / "task"))
    return Vitals(pages * _PAGE_BYTES / 1e6, len(os.listdir(at / "fd")), threads)


def redis_mb(port: int) -> float:
    """Read how much Redis has allocated (`used_memory`). Raises OSError or ValueError if it does not
    answer."""
    with socket.create_connection(("127.0.0.1", port), _ANSWER_S) as link:
        link.sendall(b"INFO memory\r\n")
        heard = b""
        while b"maxmemory:" not in heard:
            more = link.recv(65536)
            if not more:
                break
            heard += more
    found = re.search(rb"^used_memory:(\d+)", heard, re.MULTILINE)
    if found is None:
        raise ValueError("redis: no used_memory in its answer to INFO memory")
    return int(found[1]) / 1e6


def gauge(metrics: str, name: str) -> float:
    """Read one value of a relay's metrics. Raises OSError or ValueError if it is missing."""
    found = figures(metrics, f"{name} ")
    if not found:
        raise ValueError(f"{metrics}: no {name}")
    return next(iter(found.values()))


def figures(metrics: str, *beginnings: str) -> dict[str, float]:
    """Read all metrics whose lines begin so, with their labels. Raises OSError if there is no answer."""
    with urllib.request.urlopen(metrics, timeout=_ANSWER_S) as answer:
        lines = answer.read().decode().splitlines()
    found = (line.rpartition(" ") for line in lines if line.startswith(beginnings))
    return {name: float(value) for name, _, value in found}
