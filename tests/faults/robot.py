"""A robot's program for the fault suite: its pose encodes the time, written as JSON lines into a FIFO, 30 a
second.

robot.py FIFO RKN,LKN

The first two joints are the hand of a clock that goes round once an hour, by the machine's monotonic clock:
so every pose reveals when it was true. Lines on stdin: `step SECONDS` changes the robot's own clock, as a
time sync does; `stand` stops the hand; `go` lets it jump to the present and continue.
"""

from __future__ import annotations

import json
import math
import sys
import threading
import time

HZ = 30
ROUND_S = 3600.0
REACH = 100.0  # rad: the hand passes a step of the wire (0.001) in 6 ms


def hand(at_s: float) -> tuple[float, float]:
    """Where the first two joints are at that time."""
    turned = 2 * math.pi * at_s / ROUND_S
    return REACH * math.sin(turned), REACH * math.cos(turned)


def told_s(sine: float, cosine: float, near_s: float) -> float:
    """When the joints were there: of all revolutions, the time nearest to `near_s`."""
    within_s = math.atan2(sine, cosine) / (2 * math.pi) * ROUND_S
    return within_s + ROUND_S * round((near_s - within_s) / ROUND_S)


def main(fifo: str, joints: list[str]) -> None:
    """Until the FIFO is closed."""
    offset_s = [1000.0]
    standing_s: list[float] = []  # where the hand is held

    def orders() -> None:
        for line in sys.stdin:
            what, *number = line.split()
            now_s = time.monotonic()
            if what == "step":
                offset_s[0] += float(number[0])
            elif what == "stand":
                standing_s.append(now_s)
            else:
                standing_s.clear()
            print(json.dumps({"order": what, "at": now_s}), flush=True)

    threading.Thread(target=orders, daemon=True).start()
    with open(fifo, "w", buffering=1) as out:
        began_s = due_s = time.monotonic()
        while True:
            due_s = max(due_s + 1 / HZ, time.monotonic())
            time.sleep(max(0.0, due_s - time.monotonic()))
            now_s = time.monotonic()
            shown = hand(standing_s[0] if standing_s else now_s)
            pos = {joint: round(shown[at % 2], 3) for at, joint in enumerate(joints)}
            out.write(json.dumps({"t": now_s - began_s + offset_s[0], "pos": pos}) + "\n")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2].split(","))
