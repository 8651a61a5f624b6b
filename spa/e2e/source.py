"""A robot's program for tests: reads samples as JSON lines and repeats the newest one at 30 Hz on stdout.

One object a line on stdin. A member `wave: {field: {label: [amplitude, hertz, phase]}}` makes those readings
oscillate (phase in radians, default 0); with `still_at: seconds` they keep their value at that time.
Everything else is passed on unchanged. A sample with `once: true` is sent a single time, between two of the
previous one; one with `hz` is repeated at that rate instead. SIGSTOP stops this program but not the edge that
it feeds.
"""

from __future__ import annotations

import json
import math
import sys
import threading
import time
from typing import Any

HZ = 30.0
RECIPE = ("wave", "once", "still_at", "hz")


def moved(sample: dict[str, Any], t_s: float) -> dict[str, Any]:
    """The sample at `t_s` seconds: its waves applied, the recipe itself left out."""
    out = {name: value for name, value in sample.items() if name not in RECIPE}
    at_s = sample.get("still_at", t_s)
    for field, waves in sample.get("wave", {}).items():
        out[field] = {**out.get(field, {}), **{label: swing(wave, at_s) for label, wave in waves.items()}}
    return out


def swing(wave: list[float], t_s: float) -> float:
    """Of amplitude, hertz and perhaps phase."""
    amplitude, hz, *phase = wave
    return amplitude * math.sin(2 * math.pi * hz * t_s + sum(phase))


def main() -> None:
    """Until stdout closes."""
    newest: dict[str, Any] = json.loads(sys.stdin.readline())
    once: list[dict[str, Any]] = []

    def listen() -> None:
        nonlocal newest
        for line in sys.stdin:
            sample = json.loads(line)
            if sample.get("once"):
                once.append(sample)
            else:
                newest = sample

    threading.Thread(target=listen, daemon=True).start()
    try:
        while True:
            t_s = time.time()  # the machine's clock is the robot's, so arriving data can be dated
            print(json.dumps({"t": round(t_s, 4), **moved(once.pop() if once else newest, t_s)}), flush=True)
            time.sleep(1 / newest.get("hz", HZ))
    except BrokenPipeError:
        sys.stderr.close()  # the edge has left; nothing to say


if __name__ == "__main__":
    main()
