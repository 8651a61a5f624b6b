"""The same bytes to many sockets: one by one, and in one system call where that is allowed."""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack

import pytest
from posecast_relay.config.settings import parse
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.http.metrics import RelayCollector
from posecast_relay.runtime.dispatcher import MemoryStore, NoSource
from posecast_relay.runtime.fan_out import BATCH, IoUring, Short, write_each
from posecast_relay.server.access import make_access

WriteEach = Callable[[Sequence[int], bytes], Short]
Pair = Callable[[], tuple[socket.socket, socket.socket]]


@pytest.fixture(params=["one by one", "ring"])
def write(request: pytest.FixtureRequest) -> Iterator[WriteEach]:
    if request.param == "one by one":
        yield write_each
        return
    ring = IoUring.open()
    if ring is None:
        pytest.skip("no io_uring here")
    yield ring.write_each
    ring.close()


@pytest.fixture
def pair() -> Iterator[Pair]:
    """Connected sockets that do not block."""
    with ExitStack() as stack:

        def make() -> tuple[socket.socket, socket.socket]:
            near, far = socket.socketpair()
            for one in (near, far):
                stack.enter_context(one)
                one.setblocking(False)
            return near, far

        yield make


def test_every_socket_gets_the_bytes_whatever_the_batch(write: WriteEach, pair: Pair) -> None:
    pairs = [pair() for _ in range(40)]
    for turn in range(200):  # often enough for the ring to go round
        count, data = 1 + turn * 7 % 40, b"%d " % turn * (1 + turn % 50)
        assert write([near.fileno() for near, _ in pairs[:count]], data) == []
        assert all(far.recv(65536) == data for _, far in pairs[:count])


def test_a_whole_batch(write: WriteEach, pair: Pair) -> None:
    pairs = [pair() for _ in range(8)]
    assert write([near.fileno() for near, _ in pairs] * (BATCH // 8), b"x") == []
    assert all(far.recv(65536) == b"x" * (BATCH // 8) for _, far in pairs)


def test_nobody_and_nothing_wait(write: WriteEach, pair: Pair) -> None:
    assert write([], b"abc") == []
    full, other = pair(), pair()
    taken = 0
    for _ in range(10_000):
        short = write([full[0].fileno(), other[0].fileno()], b"x" * 5000)
        assert other[1].recv(65536) == b"x" * 5000
        if short:
            break
        taken += 5000
    ((index, n),) = short
    assert index == 0
    assert n == -errno.EAGAIN or 0 < n < 5000
    while chunk := full[1].recv(65536):
        taken -= len(chunk)
        if taken <= 0:
            break
    assert taken == -max(0, n)  # what is said to have been taken has arrived


def test_those_who_are_gone_hurt_nobody(write: WriteEach, pair: Pair) -> None:
    (a, a_far), (b, b_far), (c, c_far) = pair(), pair(), pair()
    b_far.close()
    closed = os.dup(a.fileno())
    os.close(closed)
    short = write([a.fileno(), closed, b.fileno(), c.fileno()], b"abc")
    assert short == [(1, -errno.EBADF), (2, -errno.EPIPE)]
    assert a_far.recv(9) == c_far.recv(9) == b"abc"


def test_a_kernel_that_forbids_it_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: IoUring, number: int, *arguments: object) -> int:
        raise OSError(errno.EPERM, "not here")

    monkeypatch.setattr(IoUring, "_call", refuse)
    assert IoUring.open() is None


def test_a_batch_that_the_kernel_does_not_begin_is_not_lost(
    monkeypatch: pytest.MonkeyPatch, pair: Pair
) -> None:
    ring = IoUring.open()
    if ring is None:
        pytest.skip("no io_uring here")
    pairs = [pair() for _ in range(3)]
    call, refused = IoUring._call, [OSError(errno.EAGAIN, "no memory now")]

    def busy(self: IoUring, number: int, *arguments: object) -> int:
        if refused:
            raise refused.pop()
        return call(self, number, *arguments)

    monkeypatch.setattr(IoUring, "_call", busy)
    descriptors = [near.fileno() for near, _ in pairs]
    assert ring.write_each(descriptors, b"abc") == [(0, 0), (1, 0), (2, 0)]  # for the transports to send
    assert ring.write_each(descriptors, b"def") == []
    assert [far.recv(9) for _, far in pairs] == [b"def"] * 3
    ring.close()


@pytest.mark.parametrize(("flags", "level"), [(["--robots", __file__], "WARNING"), (["--dev"], "INFO")])
async def test_an_admin_is_told_where_it_is_forbidden(
    flags: list[str], level: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(IoUring, "open", lambda: None)
    caplog.set_level("INFO", "posecast_relay")
    hub = Hub(Limits())
    ports = (MemoryStore(), NoSource())
    dispatcher = make_access(parse(["run", *flags], {}), None, ports, hub, None).live
    (line,) = [record for record in caplog.records if "io_uring" in record.getMessage()]
    assert (line.levelname, line.getMessage().partition(": ")[0]) == (level, "io_uring is not allowed here")
    (gauge,) = [each for each in RelayCollector([dispatcher]).collect() if each.name == "posecast_io_uring"]
    assert [sample.value for sample in gauge.samples] == [0]
