"""The robot of the lane's bench: the shared mixed set at 30 Hz, a KEY every 4 s as an agent sends them.

python -m relay.benches.lane.robot --relay tcp/127.0.0.1:7447 [--robot bench] [--hz 30] [--stamps FILE]

Prints "READY" when the relay listens to it. SIGUSR1 makes it pause: it stays connected and sends nothing;
SIGUSR2 lets it go on. `--stamps`: notes there when each frame is handed over, for `viewers`. Where the shared
sets are not there, the demo's motion stands for them.
"""

from __future__ import annotations

import argparse
import signal
import threading
import time
from collections.abc import Sequence
from itertools import count, cycle
from pathlib import Path

from posecast_edge.profile.reader import load_profile
from posecast_edge.profile.schema import make_schema_text
from posecast_edge.sources.demo import BUNDLE, PROFILE, read_motion
from posecast_wire import Encoder, Quantiser, Schema

from relay.benches.publisher import BenchUplink
from relay.benches.stamps import Stamps
from wire.python.benches.bytes_per_frame import SHARED, rows

KEY_INTERVAL_S = 4.0  # the agent's
LATE_MAX_S = 0.5  # after a pause it does not catch up
SET = SHARED / "telemetry" / "mixed.npz"
Rows = Sequence[Sequence[float | None]]


def read_feed() -> tuple[str, Schema, Rows]:
    """What it plays: its name, the schema, and the values of all channels frame by frame."""
    if SET.exists():
        schema = Schema.parse((SET.parent / "schema.json").read_text(encoding="utf-8"))
        return "mixed", schema, rows(schema, SET)[1]
    schema = Schema.parse(make_schema_text(load_profile(PROFILE)))
    motion = read_motion((BUNDLE / "motion.bin").read_bytes())
    samples = (motion.make_sample(round(n / 30 * motion.rate_hz)).values for n in range(1800))
    none = dict.fromkeys((f.name for f in schema.fields), None)
    return "demo", schema, [
        [value for f in schema.fields for value in ((none | dict(said))[f.name] or [None] * f.size)]
        for said in samples
    ]  # fmt: skip


class Pace:
    """Lets frames go, or not."""

    def __init__(self) -> None:
        self.going = threading.Event()
        self.going.set()
        signal.signal(signal.SIGUSR1, lambda *_: self.going.clear())
        signal.signal(signal.SIGUSR2, lambda *_: self.going.set())

    def wait_turn(self, due: float) -> float:
        """Wait until `due` (monotonic s) and until it may go on; when that is."""
        time.sleep(max(0.0, due - time.monotonic()))
        while not self.going.wait(0.5):
            pass
        return time.monotonic()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--relay", required=True)
    parser.add_argument("--robot", default="bench")
    parser.add_argument("--hz", type=float, default=30.0)
    parser.add_argument("--stamps", type=Path)
    asked = parser.parse_args()

    _, schema, feed = read_feed()
    quantiser, encoder = Quantiser(schema), Encoder(schema, KEY_INTERVAL_S)
    stamps = Stamps(str(asked.stamps)) if asked.stamps else None
    pace = Pace()
    uplink = BenchUplink(asked.relay, asked.robot, schema, encoder)
    uplink.announce()
    due = time.monotonic()
    for seq, sample in zip(count(1), cycle(feed), strict=False):
        now = pace.wait_turn(due)
        frame = encoder.encode(quantiser.quantise(sample), seq, now - uplink.began_ns * 1e-9, now)
        if stamps is not None:
            stamps.note(seq)
        uplink.put(frame)
        due = max(due + 1 / asked.hz, now - LATE_MAX_S)  # a late frame makes the next one no later


if __name__ == "__main__":
    main()
