"""`achd serve` as its documentation has it, in Python: one channel to any number of TCP clients."""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest

Answer = Callable[[socket.socket, dict[str, str]], None]


class Achd:
    """Listens on a free port of loopback. `newest` frames go out as they are published (get-last: 1)."""

    def __init__(self, channels: tuple[str, ...] = ("hubo-state",), port: int = 0) -> None:
        self.channels = channels
        self.headers: list[dict[str, str]] = []  # of every client
        self.instead: Answer | None = None  # answer a client this way
        self.connections = 0
        self._frame = b""
        self._number = self._taken = 0
        self._changed = threading.Condition()
        self._open: list[socket.socket] = []
        self._stopped = False
        self._listener = socket.create_server(("127.0.0.1", port))
        self.port: int = self._listener.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    @property
    def source(self) -> str:
        return f"hubo-ach:127.0.0.1:{self.port}"

    def publish(self, frame: bytes) -> None:
        with self._changed:
            self._frame, self._number = frame, self._number + 1
            self._changed.notify_all()

    def publish_surely(self, frame: bytes) -> None:
        """As `publish`, but returns when the client there is has been sent it, however busy the machine."""
        with self._changed:
            self.publish(frame)
            self._changed.wait_for(lambda: self._taken == self._number or not self._open, 10)

    def drop_clients(self) -> None:
        with self._changed:
            for client in self._open:
                with suppress(OSError):  # it has gone by itself
                    client.shutdown(socket.SHUT_RDWR)
            self._open.clear()

    def stop(self) -> None:
        self._stopped = True
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self.drop_clients()
        with self._changed:
            self._changed.notify_all()

    def _accept(self) -> None:
        while not self._stopped:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            self.connections += 1
            with self._changed:
                self._open.append(client)
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        try:
            header = self._read_header(client)
            self.headers.append(header)
            if self.instead:
                self.instead(client, header)
            elif header.get("channel-name") not in self.channels:
                refuse(client, header)
            elif header.get("direction") == "push":
                client.sendall(b"frame-count: 10\nframe-size: 3000\nstatus: 0 # ACH_OK\n.\n")
                self._push(client)
        except OSError:
            pass
        finally:
            with self._changed:
                if client in self._open:
                    self._open.remove(client)
            client.close()

    @staticmethod
    def _read_header(client: socket.socket) -> dict[str, str]:
        header: dict[str, str] = {}
        with client.makefile("rb") as lines:
            for line in lines:
                assert len(line) <= 1024
                text = line.decode().split("#")[0].strip()
                if text == ".":
                    return header
                key, _, value = text.replace("=", ":", 1).partition(":")
                header[key.strip().lower()] = value.strip()
        raise OSError("the client went before its header's end")

    def _push(self, client: socket.socket) -> None:
        seen = 0
        while not self._stopped:
            with self._changed:
                while not self._stopped and self._number == seen:
                    self._changed.wait()
                seen, frame = self._number, self._frame
            client.sendall(framed(frame))
            with self._changed:
                self._taken = seen
                self._changed.notify_all()


def framed(frame: bytes) -> bytes:
    return b"achpipe\0" + struct.pack("<Q", len(frame)) + frame


def refuse(client: socket.socket, header: dict[str, str]) -> None:
    """What achd says of a channel it does not have."""
    name = header.get("channel-name", "")
    client.sendall(f"status: 9 # ACH_ENOENT\nmessage: Couldn't open channel {name}\n.\n".encode())


@pytest.fixture
def server() -> Iterator[Achd]:
    s = Achd()
    yield s
    s.stop()
