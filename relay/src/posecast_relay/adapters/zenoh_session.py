"""The relay's own Zenoh session: on one machine it is the router that edges connect to."""

from __future__ import annotations

import json
import socket
from collections.abc import Sequence

import zenoh

LEASE_MS = 2500  # an edge whose link is cut is gone after this long
PORT_TRIES = 5


class ListenError(OSError):
    """The listener could not be opened: one line, with the endpoint."""


def _config(endpoints: Sequence[str]) -> zenoh.Config:
    config = zenoh.Config()
    for key, value in {
        "mode": "router",
        "listen/endpoints": list(endpoints),
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,  # else opening takes half a second
        "transport/link/tx/lease": LEASE_MS,
        "transport/shared_memory/enabled": False,  # drops messages silently under load
        "adminspace/enabled": False,
    }.items():
        config.insert_json5(key, json.dumps(value))
    return config


def _with_port(endpoint: str) -> str:
    """`tcp/host:0` with a port that is free just now: Zenoh would not say which it took."""
    scheme, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    if port != "0":
        return endpoint
    family = socket.AF_INET6 if host.startswith("[") else socket.AF_INET
    with socket.socket(family) as probe:
        probe.bind((host.strip("[]"), 0))
        return f"{scheme}/{host}:{probe.getsockname()[1]}"


def open_router(endpoints: Sequence[str]) -> tuple[zenoh.Session, list[str]]:
    """The session and the endpoints it listens on. ListenError when it cannot."""
    zenoh.init_log_from_env_or("off")
    for tries_left in reversed(range(PORT_TRIES)):
        real = [_with_port(e) for e in endpoints]
        try:
            return zenoh.open(_config(real)), real
        except zenoh.ZError as e:
            if tries_left and real != list(endpoints):
                continue
            reason = "address already in use" if "in use" in str(e) else str(e).splitlines()[0]
            raise ListenError(f"zenoh listener {', '.join(real)}: {reason}") from None
    raise AssertionError("unreachable")
