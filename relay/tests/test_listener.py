"""Whoever asks and never reads the answer is let go; sockets of stopped relays keep nobody waiting."""

from __future__ import annotations

import errno
import logging
import os
import signal
import socket
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest
from posecast_relay.config.settings import StartError
from posecast_relay.past.command_socket import PastSocket
from posecast_relay.past.deletions import Deletions
from posecast_relay.past.memory import MemoryPast
from posecast_relay.runtime.port_holder import explain_taken, name_holder
from posecast_relay.server import http_server
from posecast_testing import until


def fill(sock: socket.socket) -> None:
    """Write until no more is taken."""
    try:
        while True:
            sock.send(bytes(65536))
    except BlockingIOError:
        pass


def test_who_reads_nothing_is_cut_and_who_reads_slowly_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_server, "UNREAD_MS", 2000)
    with ExitStack() as stack:
        door = stack.enter_context(http_server.listen("127.0.0.1", 0))
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
        http_server.listen(host, 0)


# ---- Unix sockets -------------------------------------------------------------------


@pytest.fixture
def _no_call_blocks() -> Iterator[None]:
    """Interrupt a call that waits for ever."""

    def interrupt(*_: object) -> None:
        raise AssertionError("it waits for a process that is stopped")

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.alarm(10)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def stop_relay(path: Path, stack: ExitStack) -> None:
    """Listen at `path` without accepting, until the queue is full: as a process does that is stopped."""
    door = stack.enter_context(socket.socket(socket.AF_UNIX))
    door.bind(str(path))
    door.listen(0)
    with suppress(BlockingIOError):
        while True:
            waiting = stack.enter_context(socket.socket(socket.AF_UNIX))
            waiting.setblocking(False)
            waiting.connect(str(path))


def leave_behind(path: Path) -> None:
    """What a relay leaves at `path` that was killed."""
    with socket.socket(socket.AF_UNIX) as door:
        door.bind(str(path))


@pytest.mark.usefixtures("_no_call_blocks")
async def test_a_stopped_relay_keeps_its_past_socket(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING)
    path = tmp_path / "past"
    with ExitStack() as stack:
        stop_relay(path, stack)
        inode = path.stat().st_ino
        async with PastSocket(path, MemoryPast(1 << 20), Deletions()):
            pass
        assert path.stat().st_ino == inode
    assert "another process listens on it" in caplog.text


async def test_the_past_socket_is_this_user_s_alone_and_no_other_file_s_mode_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "past"
    leave_behind(path)
    before = os.umask(0)  # the most open one
    try:
        with monkeypatch.context() as patch:
            patch.delattr(os, "umask")  # of the whole process: other threads write files meanwhile
            async with PastSocket(path, MemoryPast(1 << 20), Deletions()):
                assert path.stat().st_mode & 0o777 == 0o600
    finally:
        os.umask(before)
    assert not path.exists()


# ---- who holds a port ----------------------------------------------------------------


@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
def test_the_program_that_listens_is_named(host: str) -> None:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.create_server((host, 0), family=family) as listener:
        named = name_holder(listener.getsockname()[1])
    assert named == f"{Path('/proc/self/comm').read_text().strip()} (process {os.getpid()})"


def test_a_free_port_has_no_holder() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    assert name_holder(port) is None
    assert (
        explain_taken(OSError(errno.EADDRINUSE, "Address already in use"), port) == "address already in use"
    )


def test_a_system_that_tells_nothing(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        assert name_holder(listener.getsockname()[1], tmp_path) is None


def test_other_errors_keep_their_words() -> None:
    assert explain_taken(OSError(errno.EACCES, "Permission denied"), 80) == "permission denied"
