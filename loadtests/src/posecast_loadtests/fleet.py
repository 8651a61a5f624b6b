"""Many robots in one process, each with its own run, liveliness token and snapshot.

python -m posecast_loadtests.fleet --relay tcp/127.0.0.1:7447 --robots 100 --hz 30

Robots are named fleet-0, fleet-1, and so on. They walk in ten groups out of step. The robots of a group send
the same frames, because encoding is the edge's load, not the relay's. Prints one line of JSON per second:
{"robots", "frames", "late"}. `late` counts ticks that began over half a period late, so that a slow generator
is not mistaken for a slow relay.
"""

from __future__ import annotations

import argparse
import json
import math
import secrets
import time
from collections.abc import Callable

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

GROUPS = 10
JOINTS = 30
VIEW = "public"


class FleetRobot:
    """One robot on air, with one view: it answers for its snapshot, and sends frames. `make_snapshot`: None
    as long as there is none."""

    def __init__(
        self, session: zenoh.Session, name: str, make_snapshot: Callable[[], Snapshot | None]
    ) -> None:
        self.began_ns = time.monotonic_ns()
        self._session, self._name, self._make_snapshot = session, name, make_snapshot
        self._run_id = secrets.randbits(63) | 1
        self.publisher = session.declare_publisher(
            frame_key(name, VIEW),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.REAL_TIME,
        )
        self._kept: list[object] = [session.declare_queryable(snapshot_key(name, VIEW), self._answer)]

    def announce(self) -> None:
        """Go on air."""
        self._kept.append(self._session.liveliness().declare_token(alive_key(self._name)))

    def put(self, frame: bytes) -> None:
        """Send a frame."""
        self.publisher.put(frame, attachment=self._stamp())

    def _stamp(self) -> bytes:
        return Stamp(self._run_id, time.monotonic_ns() - self.began_ns).pack()

    def _answer(self, query: zenoh.Query) -> None:
        snapshot = self._make_snapshot()
        if snapshot is not None:
            query.reply(snapshot_key(self._name, VIEW), snapshot.pack(), attachment=self._stamp())


class Group:
    """Robots in step: one schema, one encoder, the same frames."""

    def __init__(self, number: int) -> None:
        labels = [f"J{at}" for at in range(JOINTS)]
        fields = [
            {"name": "ref", "labels": "joint", "unit": "rad", "scale": 0.001},
            {"name": "pos", "labels": "joint", "unit": "rad", "scale": 0.001, "rel": "ref"},
        ]
        self.schema = Schema.parse(build_schema_text(f"fleet, group {number}", {"joint": labels}, fields))
        self.encoder = Encoder(self.schema)
        self.robots: list[FleetRobot] = []
        self._phase = number / GROUPS
        self._seq = 0

    def frame(self, t_s: float, now_s: float) -> bytes:
        """Return the next frame: every joint swings, and the position lags behind its reference."""
        self._seq += 1
        ref = [round(500 * math.sin(2 * t_s + self._phase * 6 + at)) for at in range(JOINTS)]
        pos = [code - at % 4 for at, code in enumerate(ref)]
        return self.encoder.encode([*ref, *pos], self._seq, t_s, now_s, force_key=self._seq == 1)

    def snapshot(self) -> Snapshot | None:
        key = self.encoder.key
        return None if key is None else Snapshot(self.schema.text, {}, key, None)


def open_session(relay: str) -> zenoh.Session:
    """Open a client session to this relay that does not discover other peers."""
    return zenoh.open(
        zenoh.Config.from_json5(
            json.dumps(
                {
                    "mode": "client",
                    "connect": {"endpoints": [relay], "timeout_ms": 5000},
                    "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
                    "transport": {"shared_memory": {"enabled": False}},
                }
            )
        )
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--relay", required=True)
    parser.add_argument("--robots", type=int, required=True)
    parser.add_argument("--hz", type=float, default=30.0)
    asked = parser.parse_args()
    groups = [Group(number) for number in range(GROUPS)]
    session = open_session(asked.relay)
    for n in range(asked.robots):
        group = groups[n % GROUPS]
        group.robots.append(FleetRobot(session, f"fleet-{n}", group.snapshot))
        group.robots[-1].announce()
    period_s = 1 / asked.hz / GROUPS
    began_s = due_s = told_s = time.monotonic()
    frames = late = 0
    while True:
        for group in groups:
            time.sleep(max(0.0, due_s - time.monotonic()))
            now_s = time.monotonic()
            late += now_s - due_s > period_s * GROUPS / 2
            due_s = max(due_s + period_s, now_s)
            frame = group.frame(now_s - began_s, now_s)
            for robot in group.robots:
                robot.put(frame)
            frames += len(group.robots)
        if due_s - told_s >= 1:
            told_s = due_s
            print(json.dumps({"robots": asked.robots, "frames": frames, "late": late}), flush=True)


if __name__ == "__main__":
    main()
