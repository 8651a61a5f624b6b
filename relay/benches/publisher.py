"""The robot of the bench: real frames of about 200 bytes through a real Zenoh session.

python -m relay.benches.publisher --relay tcp/127.0.0.1:7447 --hz 30 --stamps FILE [--robot bench]

Prints "READY" when the relay listens to it. Every channel jumps at random, so that no frame is small or
suppressed; a KEY every 4 s as an edge sends it.
"""

from __future__ import annotations

import argparse
import json
import random
import secrets
import time

import zenoh
from posecast_wire import (
    Encoder,
    Schema,
    Snapshot,
    Stamp,
    alive_key,
    build_schema_text,
    frame_key,
    snapshot_key,
)

from relay.benches.stamps import Stamps

CHANNELS = 106
REACH = 4000  # codes lie within ±REACH: about 15 bits a channel, 200 bytes a frame


def open_session(relay: str) -> zenoh.Session:
    config = zenoh.Config()
    settings: dict[str, object] = {
        "mode": "client",
        "connect/endpoints": [relay],
        "connect/timeout_ms": 5000,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


def make_schema(robot: str) -> Schema:
    labels = [f"J{i}" for i in range(CHANNELS)]
    fields = [{"name": "pos", "labels": "joint", "unit": "rad", "scale": 0.001}]
    return Schema.parse(build_schema_text(robot, {"joint": labels}, fields))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--relay", required=True)
    parser.add_argument("--robot", default="bench")
    parser.add_argument("--hz", type=float, required=True)
    parser.add_argument("--stamps", required=True)
    asked = parser.parse_args()

    stamps, schema = Stamps(asked.stamps), make_schema(asked.robot)
    encoder, run_id, began_ns = Encoder(schema), secrets.randbits(63) | 1, time.monotonic_ns()

    def attachment() -> bytes:
        return Stamp(run_id, time.monotonic_ns() - began_ns).pack()

    def answer(query: zenoh.Query) -> None:
        if encoder.key is not None:
            snapshot = Snapshot(schema.text, {}, encoder.key, encoder.ref, None)
            query.reply(snapshot_key(asked.robot, "public"), snapshot.pack(), attachment=attachment())

    session = open_session(asked.relay)
    session.declare_queryable(snapshot_key(asked.robot, "public"), answer)
    publisher = session.declare_publisher(
        frame_key(asked.robot, "public"),
        congestion_control=zenoh.CongestionControl.DROP,
        priority=zenoh.Priority.REAL_TIME,
    )
    encoder.encode([0] * schema.size, 0, 0.0, time.monotonic())
    session.liveliness().declare_token(alive_key(asked.robot))
    while not publisher.matching_status.matching:  # type: ignore[attr-defined]  # the stub says bool
        time.sleep(0.01)
    print("READY", flush=True)

    source = random.Random(1)
    seq, due = 0, time.monotonic()
    while True:
        codes = source.choices(range(-REACH, REACH + 1), k=schema.size)
        seq += 1
        now = time.monotonic()
        frame = encoder.encode(codes, seq, now - began_ns * 1e-9, now, force_key=seq == 1)
        due = max(due + stamps.period_s(asked.hz), now)
        time.sleep(max(0.0, due - time.monotonic()))
        stamps.note(seq)
        publisher.put(frame, attachment=attachment())


if __name__ == "__main__":
    main()
