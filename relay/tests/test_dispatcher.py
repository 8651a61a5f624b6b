"""Carrying out: in the core's order, a crowd in slices, and no decision while an earlier one is under way."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from uuid import uuid4

import pytest
from posecast_relay.core import messages
from posecast_relay.core.actions import Fault, RequestSnapshot, Send, SubscribeRobot, VerifyToken
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.core.stream import Stream
from posecast_relay.core.viewer import Viewer
from posecast_relay.runtime import dispatcher as dispatcher_module
from posecast_relay.runtime.dispatcher import Dispatcher, MemoryStore, NoSource
from posecast_relay.runtime.fan_out import SLICE, FanOut, IoUring
from posecast_wire import Close

from .sim import Edge, Screen, schema


class Far:
    """A viewer with a real socket; what the transport would send is only noted."""

    def __init__(self) -> None:
        self.near, self.far = socket.socketpair()
        self.near.setblocking(False)
        self.far.setblocking(False)
        self.descriptor = self.near.fileno()
        self.queued: list[bytes] = []

    def write(self, data: bytes) -> None:
        self.queued.append(data)

    def end(self, *_why: object) -> None: ...

    def cut(self, *_why: object) -> None: ...

    def read(self) -> bytes:
        try:
            return self.far.recv(1 << 20)
        except BlockingIOError:
            return b""


@pytest.fixture(params=["one by one", "ring"])
def fan_out(request: pytest.FixtureRequest) -> Iterator[FanOut]:
    ring = IoUring.open() if request.param == "ring" else None
    if ring is None and request.param == "ring":
        pytest.skip("no io_uring here")
    yield FanOut(ring)
    if ring is not None:
        ring.close()


def test_two_machines_have_different_clocks_and_one_machine_has_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dispatcher_module, "BOOT_ID", tmp_path / "boot_id")
    starts = []
    for boot_id in [*[f"{uuid4()}\n" for _ in range(20)], "no UUID"]:
        (tmp_path / "boot_id").write_text(boot_id)
        starts += [dispatcher_module._find_clock_start() for _ in range(2)]
    assert starts[::2] == starts[1::2]
    assert len(set(starts)) == 21
    assert starts[-1] == 0.0
    (tmp_path / "boot_id").unlink()
    assert dispatcher_module._find_clock_start() == 0.0


def viewer(outlet: Far | Screen) -> Viewer:
    return Viewer(outlet, "r", "public", 30.0, Limits(), 0.0)


def test_straight_to_the_sockets_but_never_past_what_waits(fan_out: FanOut) -> None:
    fars = [Far() for _ in range(40)]
    for waiting in fars[::4]:
        waiting.descriptor = -1
    fan_out.write(b"frame", [viewer(far) for far in fars])
    assert all(far.queued == [b"frame"] and far.read() == b"" for far in fars[::4])
    assert all(far.queued == [] and far.read() == b"frame" for i, far in enumerate(fars) if i % 4)


def test_what_a_socket_does_not_take_goes_to_its_transport(fan_out: FanOut) -> None:
    fars = [Far() for _ in range(40)]
    fars[7].near.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    fars[9].far.close()
    data = bytes(range(256)) * 400
    fan_out.write(data, [viewer(far) for far in fars])
    (tail,) = fars[7].queued
    assert fars[7].read() + tail == data
    assert fars[9].queued == [data]  # the transport meets the error, and ends it
    assert all(far.queued == [] and far.read() == data for i, far in enumerate(fars) if i not in {7, 9})


async def test_a_crowd_is_served_in_slices_and_frames_meanwhile_replace_each_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = iter(range(1_000_000))
    monkeypatch.setattr(Dispatcher, "now", lambda _self: 1000.0 + next(clock) / 10)  # every frame is due
    dispatcher = Dispatcher(Hub(Limits()), MemoryStore(), FanOut(None))
    edge = Edge(0xABC, schema(), began_s=dispatcher.now() - 5.0)

    def publish() -> None:
        now = dispatcher.now()
        dispatcher.hub.receive_frame("r", "public", edge.frame(now), edge.stamp(now), now)
        dispatcher.flush()

    publish()
    dispatcher.hub.take_snapshot(
        "r", "public", edge.snapshot(), edge.stamp(dispatcher.now()), dispatcher.now()
    )
    screens = [Screen() for _ in range(2 * SLICE + 10)]
    viewers = [viewer(screen) for screen in screens]
    for one in viewers:
        dispatcher.join(one)
    publish()
    served = sum(len(screen.states) == 2 for screen in screens)
    assert SLICE - 5 <= served <= SLICE
    assert all(len(screen.states) == 2 for screen in screens[:served])
    for _ in range(3):
        publish()
    dispatcher.carry_out([Send(messages.make_pong(7.0, now=0.0), viewers[:1])])
    assert not screens[0].told("pong")  # it was decided after the frame that not all have yet
    async with asyncio.timeout(20):
        while len(screens[-1].states) < 3:
            await asyncio.sleep(0)
    assert all([frame.seq for frame in screen.states] == [0, 1, 4] for screen in screens)
    assert screens[0].told("pong")
    dispatcher.stop()


class Broken(Screen):
    """A connection at which every call fails."""

    def write(self, data: bytes) -> None:
        """Outlet."""
        raise ArithmeticError("write")

    def end(self, close: Close, reason: str, retry_s: float | None, lane: str | None = None) -> None:
        """Outlet."""
        raise ArithmeticError("end")

    def cut(self, close: Close) -> None:
        """Outlet."""
        raise ArithmeticError("cut")


class BrokenStore(MemoryStore):
    """A store that fails."""

    def keep(self, stream: Stream) -> None:
        """As it says."""
        raise ArithmeticError("keep")


def fail(*_args: object) -> None:
    """A port that fails."""
    raise ArithmeticError("port")


class BrokenSource(NoSource):
    """A source that fails."""

    def request_snapshots(self, robot: str, views: Sequence[str]) -> None:
        """As it says."""
        raise ArithmeticError("request")

    def subscribe(self, robot: str) -> None:
        """As it says."""
        raise ArithmeticError("subscribe")


def serving(store: MemoryStore) -> tuple[Dispatcher, Callable[[], None]]:
    """A pump with a robot on air, and how to publish a frame of it."""
    dispatcher = Dispatcher(Hub(Limits()), store, FanOut(None), BrokenSource(), fail, fail)
    edge = Edge(0xABC, schema(), began_s=dispatcher.now() - 5.0)

    def publish() -> None:
        now = dispatcher.now()
        dispatcher.hub.receive_frame("r", "public", edge.frame(now), edge.stamp(now), now)
        dispatcher.flush()

    publish()
    dispatcher.hub.take_snapshot(
        "r", "public", edge.snapshot(), edge.stamp(dispatcher.now()), dispatcher.now()
    )
    return dispatcher, publish


async def test_ports_and_connections_that_fail_are_nobody_elses_trouble(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = iter(range(1_000_000))
    monkeypatch.setattr(Dispatcher, "now", lambda _self: 1000.0 + next(clock) / 10)  # every frame is due
    dispatcher, publish = serving(BrokenStore())
    screens = [Broken() if n % 3 == 1 else Screen() for n in range(30)]
    viewers = [viewer(screen) for screen in screens]
    for one in viewers:
        dispatcher.join(one)
    dispatcher.carry_out(
        [VerifyToken(viewers[0], "token"), RequestSnapshot("r", ("public",)), SubscribeRobot("r")]
    )
    for _ in range(5):
        publish()
    dispatcher.carry_out(dispatcher.hub.refuse(viewers[1], Close.BINARY, "binary"))
    told = Fault("r/public", ArithmeticError("told by the core"))
    dispatcher.carry_out([told, Send(messages.make_pong(7.0, now=0.0), viewers[2:])])
    sound = [screen for screen in screens[2:] if not isinstance(screen, Broken)]
    assert all(len(screen.states) == 6 and screen.told("pong") for screen in sound)
    # the first could not be verified
    assert set(dispatcher.hub.viewers) == {one for one in viewers[2:] if not isinstance(one.outlet, Broken)}
    assert dispatcher.faults["ArithmeticError"] > 20
    dispatcher.stop()


async def test_a_core_that_fails_as_a_whole_is_asked_again() -> None:
    dispatcher, publish = serving(MemoryStore())
    dispatcher.join(viewer(screen := Screen()))
    tick, dispatcher.hub.tick = dispatcher.hub.tick, fail  # type: ignore[method-assign, assignment]
    dispatcher.start()
    async with asyncio.timeout(20):
        while dispatcher.faults["ArithmeticError"] < 3:
            await asyncio.sleep(0)
    dispatcher.hub.tick = tick  # type: ignore[method-assign]
    publish()
    assert len(screen.states) == 2
    async with asyncio.timeout(20):
        while len(screen.told("status")) < 3:
            await asyncio.sleep(0)
    dispatcher.stop()
