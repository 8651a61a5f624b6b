"""Whoever asks and never reads the answer is let go."""

from __future__ import annotations

import errno
import socket
from contextlib import ExitStack

import pytest
from posecast_relay.config.settings import StartError
from posecast_relay.server import listener

from .stage import until


def fill(sock: socket.socket) -> None:
    """Write until no more is taken."""
    try:
        while True:
            sock.send(bytes(65536))
    except BlockingIOError:
        pass


def test_who_reads_nothing_is_cut_and_who_reads_slowly_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(listener, "UNREAD_MS", 2000)
    with ExitStack() as stack:
        door = stack.enter_context(listener.listen("127.0.0.1", 0))
        sides: list[tuple[socket.socket, socket.socket]] = []
        for _ in range(2):
            viewer = stack.enter_context(socket.socket())
            viewer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            viewer.connect(door.getsockname())
            relay = stack.enter_context(door.accept()[0])
            relay.setblocking(False)
            fill(relay)
            sides.append((relay, viewer))
        (stuck, _), (slow, reads) = sides

        def cut() -> bool:
            assert reads.recv(512)
            fill(slow)
            return stuck.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR) == errno.ETIMEDOUT

        until("it is cut", cut, 30)
        assert reads.recv(512)


@pytest.mark.parametrize("host", ["a..b", "a" * 80, "no.such.host.invalid"])
def test_a_host_that_is_none_is_named_in_one_line(host: str) -> None:
    with pytest.raises(StartError, match=f"^--host {host}: [^\n]+$"):
        listener.listen(host, 0)
