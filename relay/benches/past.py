"""What the past costs: µs a frame, ms a closing, and MB for half an hour of the demo robot.

`python -m relay.benches.past` plays the demo's frames, as the agent makes them, into two hubs, of which one
records. Exit status 1 when the recorder costs more than FRAME_US, CLOSING_MS or MEMORY_MB.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count

import numpy as np
from posecast_edge.pipeline.stream import Stream
from posecast_edge.profile.reader import load_profile
from posecast_edge.sources.demo import BUNDLE, PROFILE, read_motion
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.core.policy import Policy, list_lookers
from posecast_relay.core.robot import Robot
from posecast_relay.core.room import Room
from posecast_relay.past.memory import MemoryPast
from posecast_relay.past.recorder import Recorder, RecordingPorts
from posecast_wire import Snapshot, Stamp

HZ = 30
MINUTES = 30
KEY_INTERVAL_S = 4.0  # the agent's
FRAME_US, CLOSING_MS, MEMORY_MB = 50.0, 1.0, 8.0
UNIX_S = 1_800_000_000.0
RUN = 7


@dataclass
class Played:
    """The core's clock, in seconds, as far as it has been played."""

    now: float = 0.0


class TimedRecorder(Recorder):
    """Measures itself. `frame_ns`: of the frames that closed nothing; `closing_ns`: of the others."""

    def __init__(self, ports: RecordingPorts, kept: MemoryPast) -> None:
        super().__init__(ports, list_lookers)
        self.kept = kept
        self.frame_ns: list[int] = []
        self.closing_ns: list[int] = []

    def record_frame(self, robot: Robot, room: Room, now: float) -> None:
        """Record it, with the time that it takes."""
        before, began_ns = self.kept.added, time.perf_counter_ns()
        super().record_frame(robot, room, now)
        took_ns = time.perf_counter_ns() - began_ns
        (self.frame_ns if self.kept.added == before else self.closing_ns).append(took_ns)


def make_frames() -> Iterator[tuple[float, bytes, Snapshot | None]]:
    """Frames of the demo's motion, 30 a second, each with its time; the first one with a snapshot."""
    motion = read_motion((BUNDLE / "motion.bin").read_bytes())
    stream = Stream(load_profile(PROFILE), KEY_INTERVAL_S, print)
    for n in range(60 * MINUTES * HZ):
        now_s = n / HZ
        stream.deliver(motion.make_sample(round(now_s * motion.rate_hz)), now_s)
        frame = stream.tick(now_s)
        if frame is not None:
            yield now_s, frame.data, stream.make_snapshot(None, now_s) if n == 0 else None


def play(hub: Hub, frames: list[tuple[float, bytes, Snapshot | None]], played: Played) -> list[int]:
    """Give a hub all frames; how many ns each `receive_frame` took."""
    took_ns: list[int] = []
    for now_s, frame, snapshot in frames:
        stamp, now = Stamp(RUN, round(now_s * 1e9)), 1000.0 + now_s
        played.now = now
        began_ns = time.perf_counter_ns()
        hub.receive_frame("demo", "public", frame, stamp, now)
        took_ns.append(time.perf_counter_ns() - began_ns)
        if snapshot is not None:
            hub.take_snapshot("demo", "public", snapshot, stamp, now)
        hub.changed.clear()
    return took_ns


def describe(name: str, took_ns: list[int]) -> float:
    """Print one line; the median in µs."""
    median, most = float(np.median(took_ns)) / 1000, float(np.percentile(took_ns, 99)) / 1000
    print(f"{name:<34}{median:>9.1f} µs{most:>9.1f} µs (p99){len(took_ns):>8}")
    return median


def main() -> int:
    """Measure; 1 when a bound is exceeded."""
    frames = list(make_frames())
    sent = sum(len(frame) for _, frame, _ in frames)
    kept, drawn = MemoryPast(1 << 30), count(1)
    played = Played()
    ports = RecordingPorts(kept.add, lambda: next(drawn), lambda: UNIX_S + played.now)
    recorder = TimedRecorder(ports, kept)
    recorder.set_policy(Policy(), 0.0)
    plain_us = describe("a frame, nothing recorded", play(Hub(Limits()), frames, played))
    describe("a frame, recorded", play(Hub(Limits(), recorder=recorder), frames, played))
    recorder.close_all(1000.0 + 60 * MINUTES)
    frame_us = describe("of that the recorder", recorder.frame_ns)
    closing_ms = describe("of that, where a segment closes", recorder.closing_ns) / 1000
    print(f"{len(frames)} frames, {sent / 1e6:.2f} MB, in {kept.added} segments: {kept.bytes / 1e6:.2f} MB")
    print(f"recorder off: {plain_us:.1f} µs a frame; faults {sum(recorder.faults.values())}")
    return int(frame_us > FRAME_US or closing_ms > CLOSING_MS or kept.bytes / 1e6 > MEMORY_MB)


if __name__ == "__main__":
    sys.exit(main())
