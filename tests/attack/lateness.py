"""How late frames of many robots reach viewers: one viewer a robot, all in this process.

python -m tests.attack.lateness HOST:PORT NAME COUNT

Watches NAME-0, NAME-1, … Prints READY when all have sent, then [monotonic s, lateness s] for every frame: its
delay compared with the fastest of all.
"""

from __future__ import annotations

import selectors
import sys
import time

from posecast_loadtests.connection import Connection
from posecast_loadtests.results import Clock, Tally, Viewer
from websockets.frames import Opcode


class Watched:
    """One robot's stream."""

    def __init__(self, address: str, clock: Clock) -> None:
        self.link = Connection(address)
        self.link.socket.setblocking(False)
        self._viewer = Viewer(Tally(), clock, 1, decode=False)
        self.late_s: list[float] = []

    def read(self, now_s: float) -> None:
        """All that is there."""
        for opcode, payload in self.link.take(self.link.socket.recv(1 << 16)):
            if opcode is Opcode.BINARY:
                late_s = self._viewer.binary(payload, now_s)
                if late_s is not None:
                    self.late_s.append(late_s)
        self.link.acknowledge(now_s)


def main(http: str, name: str, count: int) -> None:
    """Until killed."""
    clock, selector = Clock(), selectors.DefaultSelector()
    watched = [Watched(f"ws://{http}/api/v1/robots/{name}-{n}/live?hz=60", clock) for n in range(count)]
    for one in watched:
        selector.register(one.link.socket, selectors.EVENT_READ, one)
    ready = False
    while True:
        for key, _ in selector.select(0.5):
            each: Watched = key.data
            now_s = time.monotonic()
            each.read(now_s)
            if ready:
                for late_s in each.late_s:
                    print(f"[{now_s:.4f}, {late_s:.5f}]", flush=True)
                each.late_s.clear()
        if not ready and all(one.late_s for one in watched):
            ready = True
            print("READY", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
