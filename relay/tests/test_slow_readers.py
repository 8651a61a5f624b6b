"""Who reads a kilobyte a second is never cut, whatever it is given at first; who freezes is, within 20 s."""

from __future__ import annotations

import json
from collections import deque

from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from posecast_relay.core.limits import Limits
from posecast_relay.core.viewer import Viewer
from posecast_testing import count_examples
from posecast_wire import Close

from .sim import UNIX_S, Edge, Screen, World, schema, split

STEP_S = 1 / 20
GONE_S = 20.0


class Line(Screen):
    """A viewer at the end of a slow line: what is written waits in `buffer_bytes` of the kernel, then in the
    relay. It reads so many bytes a second, answers pings, and acknowledges as the page does."""

    def __init__(self, bytes_per_s: float, buffer_bytes: int) -> None:
        super().__init__()
        self.bytes_per_s = bytes_per_s
        self.buffer_bytes = buffer_bytes
        self.waiting = 0
        self._messages: deque[tuple[int, bytes]] = deque()  # bytes written up to its end; the message
        self._written = 0
        self._read = 0.0
        self._binaries = 0
        self._acked = 0
        self._acked_at = 0.0

    def write(self, data: bytes) -> None:
        """Outlet: it arrives later."""
        assert self.was_cut is None
        at = len(data)
        ends: list[tuple[int, bytes]] = []
        for opcode, payload in reversed(list(split(data))):
            head = 2 if len(payload) < 126 else 4 if len(payload) < 1 << 16 else 10
            ends.append((self._written + at, data[at - head - len(payload) : at]))
            at -= head + len(payload)
            assert opcode in (1, 2, 9)
        self._messages.extend(reversed(ends))
        self._written += len(data)
        self.waiting += len(data)

    def read(self, world: World, viewer: Viewer, seconds: float) -> None:
        """What comes through in this time."""
        self._read = min(self._written, self._read + seconds * self.bytes_per_s)
        self.waiting = self._written - int(self._read)
        arrived = False
        while self._messages and self._messages[0][0] <= self._read:
            _, message = self._messages.popleft()
            opcode = message[0] & 0x0F
            arrived = arrived or opcode != 9
            if opcode == 9:
                viewer.record_heard(world.now)  # the pong
            self._binaries += opcode == 2
            super().write(message)
        if arrived and self._binaries > self._acked and world.now - self._acked_at >= 1.0:
            self._acked_at, self._acked = world.now, self._binaries
            world.say(viewer, type="ack", n=self._binaries)


def on_air(world: World, joints: int, events: int, event_text: int) -> Edge:
    """A robot with something to tell."""
    edge = world.on_air(schema([f"joint_{i}" for i in range(joints)]))
    for i in range(events):
        doc = {"type": "event", "t": 1.0, "level": "fault", "source": f"joint_{i}", "state": "on"}
        doc["text"] = "x" * event_text
        said = json.dumps(doc).encode()
        world.do(world.hub.take_event("r", "public", said, edge.stamp(world.now), world.now, UNIX_S))
    return edge


def join(world: World, line: Line, hz: float) -> Viewer:
    """It comes, at a socket that may not take it all."""
    viewer = Viewer(line, "r", "public", hz, world.limits, world.now)
    world.do(world.hub.join(viewer, world.now, UNIX_S))
    return viewer


def go_on(world: World, edge: Edge, viewer: Viewer, line: Line, seconds: float) -> None:
    """Frames, and what of them comes through, until it is cut."""
    end_s = world.now + seconds
    while world.now < end_s and line.was_cut is None:
        if viewer.paused_at is None and line.waiting > line.buffer_bytes:
            viewer.pause(world.now)
        elif viewer.paused_at is not None and line.waiting <= line.buffer_bytes:
            world.do(world.hub.resume_viewer(viewer))
        world.pass_time(STEP_S)
        if line.was_cut is None:
            line.read(world, viewer, STEP_S)
            world.publish(edge)


shapes = {
    "hz": st.sampled_from([1.0, 5.0, 20.0]),
    "joints": st.integers(2, 100),
    "events": st.sampled_from([0, 20, 100]),
    "event_text": st.sampled_from([0, 80, 400, 1500]),
    "buffer_bytes": st.sampled_from([4_000, 16_000, 40_000, 200_000]),
}
often = settings(
    max_examples=count_examples(15, few=4), deadline=None, suppress_health_check=[HealthCheck.too_slow]
)


@often
@given(bytes_per_s=st.sampled_from([1000.0, 1500.0, 4000.0]), **shapes)
@example(bytes_per_s=1000.0, hz=10.0, joints=30, events=100, event_text=80, buffer_bytes=40_000)
@example(bytes_per_s=1000.0, hz=20.0, joints=100, events=100, event_text=1500, buffer_bytes=4_000)
@example(bytes_per_s=1000.0, hz=20.0, joints=100, events=100, event_text=1500, buffer_bytes=200_000)
def test_who_reads_slowly_is_not_cut(
    bytes_per_s: float, hz: float, joints: int, events: int, event_text: int, buffer_bytes: int
) -> None:
    world = World()
    edge = on_air(world, joints, events, event_text)
    line = Line(bytes_per_s, buffer_bytes)
    viewer = join(world, line, hz)
    reads_s = line.waiting / bytes_per_s
    go_on(world, edge, viewer, line, reads_s + 40.0)
    assert line.was_cut is None
    assert len(line.told("event")) == events
    assert line.states


@often
@given(
    bytes_per_s=st.sampled_from([1000.0, 4000.0, 1e6]),
    freezes_after_s=st.one_of(st.just(0.0), st.floats(0.0, 40.0)),
    **shapes,
)
@example(
    bytes_per_s=1e3, freezes_after_s=0.0, hz=5.0, joints=100, events=100, event_text=1500, buffer_bytes=4000
)
@example(
    bytes_per_s=1e3, freezes_after_s=0.0, hz=1.0, joints=100, events=100, event_text=400, buffer_bytes=200_000
)
@example(
    bytes_per_s=1e3, freezes_after_s=7.9, hz=5.0, joints=100, events=100, event_text=1500, buffer_bytes=4000
)
def test_who_freezes_is_gone_within_twenty_seconds(
    bytes_per_s: float,
    freezes_after_s: float,
    hz: float,
    joints: int,
    events: int,
    event_text: int,
    buffer_bytes: int,
) -> None:
    world = World()
    edge = on_air(world, joints, events, event_text)
    line = Line(bytes_per_s, buffer_bytes)
    viewer = join(world, line, hz)
    go_on(world, edge, viewer, line, freezes_after_s)
    assert line.was_cut is None
    line.bytes_per_s, frozen_at = 0.0, world.now
    go_on(world, edge, viewer, line, GONE_S)
    assert line.was_cut in (Close.NO_ACK, Close.HALF_OPEN)
    assert world.now - frozen_at <= GONE_S


def test_the_longest_patience_is_what_the_limits_add_up_to() -> None:
    limits = Limits()
    assert limits.join_burst_s + limits.half_open_s + limits.sweep_s < GONE_S
    assert limits.ping_bytes / limits.slowest_bytes_per_s < limits.half_open_s
