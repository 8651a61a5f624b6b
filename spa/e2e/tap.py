"""Listens on Zenoh beside a relay and prints every frame of one robot, decoded, one JSON object a line.

tap.py tcp/127.0.0.1:7447 demo

It decodes what the edge publishes, so a test can compare a page or a relay with it. For a frame whose base is
missing it requests the edge's snapshot, as the relay does; that frame is not printed.
"""

from __future__ import annotations

import json
import math
import queue
import sys
from typing import Any

import zenoh
from posecast_wire.decoder import Decoder, Frame
from posecast_wire.frame import BaseUnknown, FrameError
from posecast_wire.keys import Snapshot, frame_key, snapshot_key
from posecast_wire.mapping import compute_joint_values

VIEW = "public"


def described(frame: Frame) -> dict[str, Any]:
    """Every field by label (a reading or null) and the mapped joints, as `TappedFrame` in stack.ts."""
    values = {
        field.name: dict(zip(field.labels, frame.values(field.name), strict=True))
        for field in frame.schema.fields
    }
    joints = compute_joint_values(frame.schema, frame.codes, "pos")
    return {
        "seq": frame.seq,
        "t_s": frame.t_s,
        "values": values,
        "joints": {name: None if math.isnan(value) else value for name, value in joints.items()},
    }


def main(relay: str, robot: str) -> None:
    """Until killed."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([relay]))
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("transport/shared_memory/enabled", "false")
    session = zenoh.open(config)
    arrived: queue.Queue[bytes] = queue.Queue()
    _subscriber = session.declare_subscriber(
        frame_key(robot, VIEW), lambda sample: arrived.put(sample.payload.to_bytes())
    )
    decoder = Decoder()
    while True:
        message = arrived.get()
        try:
            print(json.dumps(described(decoder.decode(message))), flush=True)
        except BaseUnknown:
            for reply in session.get(snapshot_key(robot, VIEW), timeout=1.0):
                if reply.ok is None:
                    continue
                snapshot = Snapshot.unpack(reply.ok.payload.to_bytes())
                decoder.add_schema(snapshot.schema)
                decoder.decode(snapshot.key)
        except FrameError as error:
            sys.exit(f"tap: {error}")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
