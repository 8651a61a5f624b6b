"""A viewer in a separate process: it measures the relay's lateness, not that of a busy load generator.

python -m posecast_loadtests.control ws://127.0.0.1:8080/api/v1/robots/demo/live?hz=10 3

Prints its counts as one line of JSON when its standard input ends. The second argument is the number of robot
frames per viewer frame.
"""

from __future__ import annotations

import json
import sys
import threading
from contextlib import suppress

from websockets.frames import Opcode

from posecast_loadtests.connection import Connection, ProtocolError
from posecast_loadtests.results import Clock, Tally, Viewer


def watch(address: str, step: int, tally: Tally, ended: threading.Event) -> None:
    """Watch until `ended`, reconnecting whenever the relay closes."""
    viewer, came = Viewer(tally, Clock(), step, decode=True), 0
    while not ended.wait(0.2 if came else 0):
        viewer.connected()
        came += 1
        with suppress(OSError, ProtocolError):
            link = Connection(address)
            for opcode, payload, arrival_s in link.messages():
                if ended.is_set():
                    link.close()
                    return
                if opcode is Opcode.BINARY:
                    viewer.binary(payload, arrival_s)
                elif opcode is Opcode.TEXT and json.loads(payload).get("type") == "schema":
                    viewer.schema(payload.decode())
        tally.closed += 1


def main() -> None:
    tally, ended = Tally(), threading.Event()
    threading.Thread(target=watch, args=(sys.argv[1], int(sys.argv[2]), tally, ended), daemon=True).start()
    sys.stdin.read()
    ended.set()
    print(json.dumps(tally.counts()))


if __name__ == "__main__":
    main()
