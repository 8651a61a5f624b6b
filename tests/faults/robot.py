"""A robot's program for the fault suite: swinging joints as JSON lines into a FIFO, 30 a second.

    robot.py FIFO RKN,LKN

A line `step SECONDS` on stdin moves its clock, as a robot's does when it finds the time.
"""

from __future__ import annotations

import json
import sys
import threading
import time

HZ = 30


def main(fifo: str, joints: list[str]) -> None:
    offset_s = [1000.0]

    def orders() -> None:
        for line in sys.stdin:
            offset_s[0] += float(line.split()[1])
            print(f"clock moved by {line.split()[1]}", flush=True)

    threading.Thread(target=orders, daemon=True).start()
    with open(fifo, "w", buffering=1) as out:
        began_s = due_s = time.monotonic()
        while True:
            due_s = max(due_s + 1 / HZ, time.monotonic())
            time.sleep(max(0.0, due_s - time.monotonic()))
            t_s = time.monotonic() - began_s
            pos = {joint: round((t_s + at) % 2 - 1, 3) for at, joint in enumerate(joints)}
            out.write(json.dumps({"t": t_s + offset_s[0], "pos": pos}) + "\n")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2].split(","))
