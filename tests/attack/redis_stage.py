"""An ingest and a gateway with a Redis between them."""

from __future__ import annotations

import socket
from collections.abc import Callable
from contextlib import suppress

from posecast_testing import free_port, until

from tests.attack.arena import Arena


class RedisStage:
    """Robots connect to the ingest (`zenoh`), viewers to the gateway (`http`)."""

    def __init__(self, made: Arena) -> None:
        self._arena = made
        self.port = free_port()
        redis = ("redis-server", "--port", str(self.port), "--bind", "127.0.0.1", "--save", "")
        made.start("redis", *redis, "--appendonly", "no", "--dir", str(made.folder))
        until("redis answers", lambda: self.ask("PING").startswith(b"+PONG"))
        self._store = ("--store", f"redis://127.0.0.1:{self.port}/0")
        self.ingest, _, self.zenoh = made.relay("--role", "ingest", *self._store)
        self.gateway, self.http, _ = made.relay("--role", "gateway", *self._store)

    def ask(self, *words: str) -> bytes:
        """Redis's answer; empty when there is none."""
        with suppress(OSError), socket.create_connection(("127.0.0.1", self.port), 1.0) as link:
            link.sendall(" ".join(words).encode() + b"\r\n")
            return link.recv(4096)
        return b""

    def restart_ingest(self, meanwhile: Callable[[], object]) -> None:
        """Killed, and started on the same port after `meanwhile`."""
        self.ingest.kill()
        meanwhile()
        again = ("--role", "ingest", *self._store, "--zenoh-listen", f"tcp/{self.zenoh}")
        self.ingest, _, _ = self._arena.relay(*again)
