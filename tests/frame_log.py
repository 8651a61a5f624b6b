"""Prints every frame of robot `demo` that a relay's router passes on: `SEQ SENT_S ARRIVED_S`.

SENT_S counts from the beginning of the run, ARRIVED_S is this machine's monotonic clock.

    frame_log.py tcp/127.0.0.1:RELAY
"""

from __future__ import annotations

import json
import sys
import time

import zenoh
from posecast_wire.frame import frame_id, parse_header
from posecast_wire.keys import Stamp, frame_key


class Log:
    """Numbers frames by the KEY they are coded against; a frame whose KEY was lost is lost too."""

    def __init__(self) -> None:
        self._seq_of: dict[int | None, int] = {None: 0}

    def on_frame(self, sample: zenoh.Sample) -> None:
        """One line."""
        now_s = time.monotonic()
        frame = sample.payload.to_bytes()
        header = parse_header(frame)
        base = self._seq_of.get(header.base_id)
        if base is None or sample.attachment is None:
            return
        if header.is_key:
            self._seq_of[frame_id(frame)] = base + header.seq
        sent_s = Stamp.unpack(sample.attachment.to_bytes()).elapsed_ns / 1e9
        print(base + header.seq, sent_s, now_s, flush=True)


def main(endpoint: str) -> None:
    """Until killed."""
    config = zenoh.Config()
    for key, value in {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
    }.items():
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config) as session:
        session.declare_subscriber(frame_key("demo", "public"), Log().on_frame)
        sys.stdin.read()


if __name__ == "__main__":
    main(sys.argv[1])
