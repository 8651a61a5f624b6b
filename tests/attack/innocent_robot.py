"""An innocent robot: 30 frames a second from a separate process.

python -m tests.attack.innocent_robot HOST:PORT NAME [SECRET]

{"sent": seq, "at": monotonic s} for every frame. Its first two joints are the hand of `tests.faults.robot`. A
line `clock SECONDS` on stdin: from now on its timestamps are this far behind, as after a laptop's sleep.
"""

from __future__ import annotations

import json
import secrets
import sys
import threading
import time

import zenoh
from posecast_wire import Encoder, Snapshot, Stamp, alive_key, frame_key, snapshot_key

from tests.attack.hostile_robot import open_session, schema_of
from tests.attack.target import Target
from tests.faults.robot import hand

HZ = 30
JOINTS = 24
BEGAN_S = 100.0  # ago, by its stamps: so that these can go back


def main(endpoint: str, name: str, secret: str | None) -> None:
    """Until killed."""
    schema = schema_of(JOINTS)
    encoder, run_id = Encoder(schema), secrets.randbits(63) | 1
    began_s = [time.monotonic() - BEGAN_S]

    def stamp() -> bytes:
        return Stamp(run_id, round((time.monotonic() - began_s[0]) * 1e9)).pack()

    def answer(query: zenoh.Query) -> None:
        if encoder.key is not None:
            snapshot = Snapshot(schema.text, {"name": name}, encoder.key, None)
            query.reply(snapshot_key(name, "public"), snapshot.pack(), attachment=stamp())

    def orders() -> None:
        for line in sys.stdin:
            began_s[0] += float(line.split()[1])

    threading.Thread(target=orders, daemon=True).start()
    session = open_session(Target("", endpoint, 0.0), name, secret)
    kept = [
        session.declare_queryable(snapshot_key(name, "public"), answer),
        session.liveliness().declare_token(alive_key(name)),
    ]
    frames = session.declare_publisher(
        frame_key(name, "public"),
        congestion_control=zenoh.CongestionControl.DROP,
        priority=zenoh.Priority.REAL_TIME,
    )
    seq, due_s = 0, time.monotonic()
    while kept:
        due_s = max(due_s + 1 / HZ, time.monotonic())
        time.sleep(max(0.0, due_s - time.monotonic()))
        now_s, seq = time.monotonic(), seq + 1
        codes = [round(x * 1000) for x in hand(now_s)] + [seq % 1000] * (JOINTS - 2)
        payload = encoder.encode(codes, seq, now_s, now_s)
        frames.put(payload, attachment=stamp())
        print(json.dumps({"sent": seq, "at": now_s}), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3] if len(sys.argv) > 3 else None)
