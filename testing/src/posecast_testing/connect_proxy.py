"""An HTTP proxy that only opens connections: `python -m posecast_testing.connect_proxy HOST PORT [LOGIN]`.

LOGIN is USER:PASSWORD. It allows port 443 and those of the environment's ALLOWED, and prints each request's
first line.
"""

from __future__ import annotations

import base64
import os
import socket
import sys
import threading
from contextlib import suppress

HEAD_BYTES_MAX = 4096


class ConnectProxy:
    """Runs in threads until `close`. `requests`: the first line of each; `login`: USER:PASSWORD, None for
    everybody; `lead`: where a host and port are found, for names that only the proxy knows."""

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 0,
        login: str | None = None,
        lead: dict[tuple[str, int], tuple[str, int]] | None = None,
    ) -> None:
        self.requests: list[str] = []
        self._login, self._lead = login, lead or {}
        self._listener = socket.create_server((host, port))
        self.address: tuple[str, int] = self._listener.getsockname()[:2]
        threading.Thread(target=self._accept, daemon=True).start()

    @property
    def url(self) -> str:
        """With the login, if it wants one."""
        login = "" if self._login is None else f"{self._login}@"
        return f"http://{login}{self.address[0]}:{self.address[1]}"

    def close(self) -> None:
        """Accept no more; open connections go on."""
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                threading.Thread(target=self._serve, args=(near,), daemon=True).start()

    def _serve(self, near: socket.socket) -> None:
        with near, suppress(OSError, ValueError):
            head = b""
            while not head.endswith(b"\r\n\r\n") and len(head) < HEAD_BYTES_MAX:
                head += near.recv(1)
            first, *rest = head.decode().split("\r\n")
            self.requests.append(first)
            print(first, flush=True)
            method, target, _ = first.split()
            if self._login is not None:
                word = base64.b64encode(self._login.encode()).decode()
                if f"Proxy-Authorization: Basic {word}" not in rest:
                    near.sendall(b"HTTP/1.1 407 who\r\nProxy-Authenticate: Basic realm=test\r\n\r\n")
                    return
            host, _, port = target.rpartition(":")
            at = self._lead.get((host.strip("[]"), int(port)))
            if method != "CONNECT" or at is None:
                near.sendall(b"HTTP/1.1 403 no\r\n\r\n")
                return
            try:
                far = socket.create_connection(at, 5)
            except OSError:
                near.sendall(b"HTTP/1.1 502 away\r\n\r\n")
                return
            far.settimeout(None)
            near.sendall(b"HTTP/1.1 200 ok\r\nVia: test\r\n\r\n")
            threading.Thread(target=_pipe, args=(far, near), daemon=True).start()
            _pipe(near, far)


def _pipe(source: socket.socket, sink: socket.socket) -> None:
    with suppress(OSError):
        while data := source.recv(65536):
            sink.sendall(data)
    for end in (source, sink):
        with suppress(OSError):
            end.shutdown(socket.SHUT_RDWR)


def main() -> None:
    """Run until the process is ended. `LEAD` in the environment: NAME:PORT=HOST:PORT, separated by commas."""
    lead = {}
    for entry in filter(None, os.environ.get("LEAD", "").split(",")):
        asked, _, at = entry.partition("=")
        (name, _, port), (host, _, at_port) = asked.rpartition(":"), at.rpartition(":")
        lead[name, int(port)] = host, int(at_port)
    login = sys.argv[3] if len(sys.argv) > 3 else None
    ConnectProxy(sys.argv[1], int(sys.argv[2]), login, lead)
    threading.Event().wait()


if __name__ == "__main__":
    main()
