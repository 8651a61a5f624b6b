"""The robot of the bench: real frames of about 200 bytes through a real Zenoh session.

python -m relay.benches.publisher --relay tcp/127.0.0.1:7447 --hz 30 --stamps FILE [--robot bench]
    [--bytes 200]

Prints "READY" when the relay listens to it. Every channel jumps at random, so that no frame is small or
suppressed; a KEY every 4 s as an edge sends it.
"""

from __future__ import annotations

import argparse
import random
import time

from posecast_loadtests.fleet import FleetRobot, open_session
from posecast_wire import Encoder, Schema, Snapshot, build_schema_text
from posecast_wire.frame import HEADER, KEY_HEADER, TAG_KEY, TAG_PLAIN, frame_id

from relay.benches.stamps import Stamps

CHANNELS_PER_BYTE = 106 / 200
# larger frames are one KEY and one plain frame with new headers: Python can't encode so many in time
DRAWN_BYTES = 1000
KEY_EVERY_S = 4.0
REACH = 4000  # codes lie within ±REACH: about 15 bits a channel


class BenchUplink(FleetRobot):
    """A run of a robot with one view, as an agent has it."""

    def __init__(self, relay: str, robot: str, schema: Schema, encoder: Encoder) -> None:
        def make_snapshot() -> Snapshot | None:
            return None if encoder.key is None else Snapshot(schema.text, {}, encoder.key, None)

        super().__init__(open_session(relay), robot, make_snapshot)

    def announce(self) -> None:
        """Go on air; print "READY" when the relay listens."""
        super().announce()
        while not self.publisher.matching_status.matching:  # type: ignore[attr-defined]  # the stub says bool
            time.sleep(0.01)
        print("READY", flush=True)


def make_schema(robot: str, frame_bytes: int) -> Schema:
    labels = [f"J{i}" for i in range(round(frame_bytes * CHANNELS_PER_BYTE))]
    fields = [{"name": "pos", "labels": "joint", "unit": "rad", "scale": 0.001}]
    return Schema.parse(build_schema_text(robot, {"joint": labels}, fields))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--relay", required=True)
    parser.add_argument("--robot", default="bench")
    parser.add_argument("--hz", type=float, required=True)
    parser.add_argument("--stamps", required=True)
    parser.add_argument("--bytes", type=int, default=200, help="of a frame, about")
    asked = parser.parse_args()

    stamps, schema = Stamps(asked.stamps), make_schema(asked.robot, asked.bytes)
    encoder = Encoder(schema)
    uplink = BenchUplink(asked.relay, asked.robot, schema, encoder)
    source = random.Random(1)

    def draw() -> list[int]:
        return source.choices(range(-REACH, REACH + 1), k=schema.size)

    first, second = (encoder.encode(draw(), seq, 0.0, time.monotonic()) for seq in (0, 1))
    base = first, 0, float("-inf")  # the newest KEY of larger frames, its number and time
    uplink.announce()

    def make(seq: int, now: float) -> bytes:
        t_s = now - uplink.began_ns * 1e-9
        if asked.bytes > DRAWN_BYTES:
            nonlocal base
            if t_s - base[2] >= KEY_EVERY_S:
                key = KEY_HEADER.pack(TAG_KEY, schema.id, seq, t_s) + first[KEY_HEADER.size :]
                base = key, seq, t_s
                return key
            key, key_seq, key_t_s = base
            header = HEADER.pack(TAG_PLAIN, frame_id(key), seq - key_seq, round(1000 * (t_s - key_t_s)))
            return header + second[HEADER.size :]
        return encoder.encode(draw(), seq, t_s, now, force_key=seq == 1)

    seq, due = 0, time.monotonic()
    while True:
        seq += 1
        now = time.monotonic()
        frame = make(seq, now)
        due = max(due + stamps.period_s(asked.hz), now)
        time.sleep(max(0.0, due - time.monotonic()))
        stamps.note(seq)
        uplink.put(frame)


if __name__ == "__main__":
    main()
