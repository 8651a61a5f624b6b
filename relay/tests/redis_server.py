"""A real Redis for tests, which can be frozen and killed. Ended by its process."""

from __future__ import annotations

import shutil
import signal
import socket
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from posecast_testing import free_port, is_listened_on, until


class Redis:
    """A Redis server of the test's own; nothing on disk."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.port = free_port()
        self.url = f"redis://127.0.0.1:{self.port}"
        self._folder = folder
        self._options = options
        self.process: subprocess.Popen[bytes] | None = None

    def start(self, tls: Path | None = None) -> None:
        """Until it answers. `tls`: only to those who speak it, with the certificates in that folder."""
        self.launch(tls)
        until("redis answers", (lambda: is_listened_on(self.port)) if tls else self._answers)

    def launch(self, tls: Path | None = None) -> None:
        """Without waiting."""
        plain_port = str(0 if tls else self.port)
        command = ["redis-server", "--bind", "127.0.0.1", "--save", "", "--port", plain_port]
        if tls is not None:
            command += ["--tls-port", str(self.port), "--tls-ca-cert-file", str(tls / "ca.pem")]
            command += ["--tls-cert-file", str(tls / "redis.pem"), "--tls-key-file", str(tls / "redis.key")]
        command.append("--dir")
        command += [str(self._folder), *self._options]
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL)

    def _answers(self) -> bool:
        with suppress(OSError), socket.create_connection(("127.0.0.1", self.port), 1.0) as probe:
            probe.sendall(b"PING\r\n")
            return probe.recv(7) == b"+PONG\r\n"
        return False

    def freeze(self) -> None:
        """It stands still; its sockets stay open."""
        assert self.process is not None
        self.process.send_signal(signal.SIGSTOP)

    def thaw(self) -> None:
        """It goes on."""
        assert self.process is not None
        self.process.send_signal(signal.SIGCONT)

    def kill(self) -> None:
        """At once, with all it held."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process = None


@pytest.fixture
def redis_server(tmp_path: Path) -> Iterator[Redis]:
    """A running Redis."""
    if shutil.which("redis-server") is None:
        pytest.skip("no redis-server here: apt-get install redis-server")
    server = Redis(tmp_path)
    server.start()
    yield server
    server.kill()
