"""Prints a robot's newest state in a Redis, decoded, as one JSON object: `stored.py redis://… demo`."""

from __future__ import annotations

import json
import sys

import redis
from posecast_wire.decoder import Decoder

VIEW = "public"


def main(url: str, robot: str) -> None:
    """Exits with one line if nothing is stored."""
    store = redis.Redis.from_url(url)
    key = f"posecast:{{{robot}}}:{VIEW}:state"
    state: dict[bytes, bytes] = store.hgetall(key)  # type: ignore[assignment]
    if not state:
        sys.exit(f"nothing under {key}; keys: {sorted(store.keys('*'))}")
    decoder = Decoder()
    decoder.add_schema(state[b"schema"].decode())
    decoder.decode(state[b"key"])
    frame = decoder.decode(state[b"frame"])
    labels = frame.schema.find_field("pos")
    values = dict(zip(labels.labels if labels else (), frame.values("pos"), strict=True))
    json.dump({"seq": frame.seq, "pos": values}, sys.stdout)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
