"""Compares the bytes of the same motion as WebSocket frames and as segments, for the shared telemetry sets.

python -m tools.segment_bytes: encodes each set as the agent does, records it as the relay does, and prints
the bytes sent to a viewer either way, without HTTP, TLS and TCP headers. Robots send 10 and 30 frames a
second, with a KEY every 2, 4 and 10 s. A relay closes a segment after 6 s at most; for longer ones the limit
is raised in this script only, and the line says so.
"""

from __future__ import annotations

import random
import sys
from itertools import count, product
from pathlib import Path
from typing import NamedTuple

from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.core.policy import Policy, list_lookers
from posecast_relay.past import recorder as recording
from posecast_relay.past.memory import MemoryPast
from posecast_relay.past.recorder import Recorder, RecordingPorts
from posecast_relay.past.segment import KeptSegment
from posecast_wire import Encoder, Quantiser, Schema, Snapshot, Stamp

from wire.python.benches.bytes_per_frame import SETS, SHARED, rows

SET_HZ = 30  # the sets' own
RATES_HZ = (10, 30)
KEY_INTERVALS_S = (2.0, 4.0, 10.0)
START_S = 1000.0  # of the core's clock
UNIX_S = 1_800_000_000.0
UPLINK_S = (0.002, 0.012)  # transit time of a frame to the relay, at random
RUN = 7


class Played(NamedTuple):
    """One set at one rate and KEY interval. `seconds`: how long all whole segments last together."""

    frame_bytes: float
    segments: int
    seconds: float
    bytes: int
    is_bound_raised: bool

    @property
    def segment_s(self) -> float:
        """How long a segment lasts on average."""
        return self.seconds / self.segments

    @property
    def bytes_per_s(self) -> float:
        """Segment bytes per second of the robot's time."""
        return self.bytes / self.seconds


def play(text: str, path: Path, hz: int, key_interval_s: float, segment_s_max: float) -> Played:
    """Encode a set and record it. `segment_s_max`: the maximum length of a segment."""
    schema = Schema.parse(text)
    _, values = rows(schema, path)
    quantiser, encoder, draw = Quantiser(schema), Encoder(schema, key_interval_s), random.Random(1)
    kept, drawn, now_s = MemoryPast(1 << 30), count(1), START_S
    ports = RecordingPorts(kept.add, lambda: next(drawn), lambda: UNIX_S + now_s)
    recorder = Recorder(ports, list_lookers)
    recorder.set_policy(Policy(), START_S)
    hub, frames = Hub(Limits(), recorder=recorder), []
    bound_s, recording.LENGTH_S = recording.LENGTH_S, segment_s_max
    try:
        for seq, sample in enumerate(values[:: SET_HZ // hz]):
            sent_s = seq / hz
            frame = encoder.encode(quantiser.quantise(sample), seq, sent_s, sent_s)
            stamp, now_s = Stamp(RUN, round(sent_s * 1e9)), START_S + sent_s + draw.uniform(*UPLINK_S)
            recorder.close_due(now_s)
            hub.receive_frame("hubo", "public", frame, stamp, now_s)
            if seq == 0:
                hub.take_snapshot("hubo", "public", Snapshot(text, {}, frame, None), stamp, now_s)
            hub.changed.clear()
            frames.append(len(frame))
    finally:
        recording.LENGTH_S = bound_s
    if recorder.faults:
        raise AssertionError(f"{path.stem}: {dict(recorder.faults)}")
    whole: list[KeptSegment] = kept.list_segments("hubo", "public")
    return Played(
        sum(frames) / len(frames),
        len(whole),
        sum(each.frames for each in whole) / hz,
        sum(len(each.data) for each in whole),
        segment_s_max > bound_s,
    )


def main() -> int:
    """Print a line for each set, rate and interval; if the data are missing, print a note and return 0."""
    path = SHARED / "telemetry" / "schema.json"
    if not path.exists():
        print("skipped: the telemetry sets are missing (set POSECAST_SHARED to their folder)")
        return 0
    text = path.read_text(encoding="utf-8")
    print("set         Hz  KEY s   frame B  frames B/s   segment s  segment B  segments B/s")
    for name, hz, key_s in product(SETS, RATES_HZ, KEY_INTERVALS_S):
        for longest_s in sorted({recording.LENGTH_S, max(recording.LENGTH_S, key_s + 1)}):
            played = play(text, SHARED / "telemetry" / f"{name}.npz", hz, key_s, longest_s)
            line = (
                f"{name:<10}{hz:>4}{key_s:>7.0f}{played.frame_bytes:>10.1f}{hz * played.frame_bytes:>12.0f}"
            )
            line += f"{played.segment_s:>12.2f}{played.bytes / played.segments:>11.0f}"
            print(f"{line}{played.bytes_per_s:>14.0f}{'  bound raised' if played.is_bound_raised else ''}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
