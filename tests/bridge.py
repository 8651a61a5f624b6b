"""A man in the middle on Zenoh: an edge thinks it is the relay, the relay thinks it is the edge.

bridge.py tcp/127.0.0.1:RELAY ROBOT

Prints `listening tcp/127.0.0.1:PORT` for the edge. Everything passes both ways unchanged, except that after a
line `drop` on stdin (answered by `armed`) exactly the next KEY is dropped (`dropped SEQ`).
"""

from __future__ import annotations

import json
import socket
import sys
import threading

import zenoh
from posecast_wire.frame import parse_header
from posecast_wire.keys import alive_key, echo_key, frame_key, model_key, snapshot_key

VIEW = "public"


def opened(mode: str, direction: str, endpoint: str) -> zenoh.Session:
    """A session without discovery."""
    config = zenoh.Config()
    for key, value in {
        "mode": mode,
        f"{direction}/endpoints": [endpoint],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,
        "transport/shared_memory/enabled": False,
    }.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


def answer(query: zenoh.Query, other: zenoh.Session) -> None:
    """Forwards a query to the other side and returns its answers."""
    for reply in other.get(query.selector, timeout=2.0):
        if reply.ok is not None:
            query.reply(reply.ok.key_expr, reply.ok.payload, attachment=reply.ok.attachment)


def main(relay: str, robot: str) -> None:
    """Until killed."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    listen = f"tcp/127.0.0.1:{port}"
    edge_side, relay_side = opened("router", "listen", listen), opened("client", "connect", relay)
    drop = threading.Event()
    frames = frame_key(robot, VIEW)
    lasting: list[object] = []

    def forward(sample: zenoh.Sample) -> None:
        payload = sample.payload.to_bytes()
        if not lasting:
            lasting.append(relay_side.liveliness().declare_token(alive_key(robot)))
        if str(sample.key_expr) == frames and drop.is_set():
            header = parse_header(payload)
            if header.is_key:
                drop.clear()
                print(f"dropped {header.seq}", flush=True)
                return
        relay_side.put(sample.key_expr, payload, attachment=sample.attachment)

    keep = [
        edge_side.declare_subscriber(f"posecast/v1/{robot}/{VIEW}/*", forward),
        relay_side.declare_queryable(snapshot_key(robot, VIEW), lambda query: answer(query, edge_side)),
        relay_side.declare_queryable(model_key(robot, "**"), lambda query: answer(query, edge_side)),
        edge_side.declare_queryable(echo_key(robot), lambda query: answer(query, relay_side)),
    ]
    print(f"listening {listen}", flush=True)
    for _ in sys.stdin:
        drop.set()
        print("armed", flush=True)
    del keep


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
