"""A second Zenoh router between robot and relay, as in labs with several machines.

router.py tcp/127.0.0.1:LISTEN tcp/127.0.0.1:RELAY
"""

from __future__ import annotations

import json
import sys

import zenoh


def main(listen: str, relay: str) -> None:
    """Until killed."""
    config = {
        "mode": "router",
        "listen": {"endpoints": [listen]},
        "connect": {"endpoints": [relay], "timeout_ms": -1, "exit_on_failure": False},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"shared_memory": {"enabled": False}},
    }
    with zenoh.open(zenoh.Config.from_json5(json.dumps(config))):
        print(f"listening {listen}", flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
