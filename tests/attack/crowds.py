"""Many innocent clients: a hundred robots beside one that floods, a thousand viewers that arrive at once."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence

from posecast_testing import Process, until

from tests.attack.arena import Arena, arena, said
from tests.attack.figure import Figure

ROBOTS = 100
HZ = 30
FLOOD = "plain-frames-3000"  # as many as all of them together
PAIRS = 3
TURN_S = 1.5
RATIO_MAX = 1.25
VIEWERS = 1000
IN_MAX_S = 10.0


def percentile(values: Sequence[float], share: float) -> float:
    """The value below which this share of them lies; infinite if there are none."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(len(ordered) * share))] if ordered else float("inf")


def beside_a_flood(relay_command: tuple[str, ...]) -> list[Figure]:
    """p99 of the lateness of a hundred robots' frames, with a flood ÷ without; the median of three."""
    with arena(relay_command) as made:
        _, http, zenoh = made.relay()
        fleet = ["-m", "posecast_loadtests.fleet", "--relay", f"tcp/{zenoh}"]
        made.start("fleet", sys.executable, *fleet, "--robots", str(ROBOTS), "--hz", str(HZ))
        viewers = made.module("lateness", http, "fleet", str(ROBOTS))
        viewers.line("READY")
        turns = [(_turn(None), _turn(_flood(made, http, zenoh))) for _ in range(PAIRS)]
        late = [json.loads(line) for line in viewers.out.splitlines() if line[0] == "["]

    def p99_s(turn: tuple[float, float]) -> float:
        return percentile([late_s for at, late_s in late if turn[0] <= at <= turn[1]], 0.99)

    pairs = [(p99_s(flooded), p99_s(calm)) for calm, flooded in turns]
    with_s, without_s = sorted(pairs, key=lambda pair: pair[0] / pair[1])[PAIRS // 2]
    more = f": {with_s * 1e3:.1f} ms beside {without_s * 1e3:.1f} ms, {len(late):,} frames"
    what = f"{ROBOTS} robots at {HZ} Hz beside one that floods: p99 of their lateness ÷ p99 without it"
    return [Figure(what, with_s / without_s, RATIO_MAX, "×", more)]


def _flood(made: Arena, http: str, zenoh: str) -> Process:
    attacker = made.module("attacker", FLOOD, http, zenoh, f"{TURN_S:g}", nice=True)
    attacker.line("READY")
    return attacker


def _turn(attacker: Process | None) -> tuple[float, float]:
    began_s = time.monotonic()
    if attacker is not None:
        assert attacker.process.stdin is not None
        attacker.process.stdin.write(b"go\n")
        attacker.process.stdin.flush()
    time.sleep(TURN_S)
    ended_s = time.monotonic()
    if attacker is not None:
        attacker.kill()
        time.sleep(0.2)  # what it left
    return began_s, ended_s


def coming_at_once(relay_command: tuple[str, ...]) -> list[Figure]:
    """Seconds until the last of a thousand viewers from one address says LIVE."""
    with arena(relay_command) as made:
        _, http, zenoh = made.relay()
        robot = made.robot(zenoh)
        until("the robot sends", lambda: "sent" in robot.out)
        began_s = time.monotonic()
        url = f"ws://{http}/api/v1/robots/innocent/live?hz=1"
        hall = made.start("hall", sys.executable, str(made.screen_program), url, str(VIEWERS))
        live: dict[int, float] = {}
        while len(live) < VIEWERS and time.monotonic() - began_s < 2 * IN_MAX_S:
            time.sleep(0.2)
            for line in said(hall, "word"):
                if line["word"] == "LIVE":
                    live.setdefault(line["viewer"], line["at"] - began_s)
        last_s = max(live.values()) if len(live) == VIEWERS else float("inf")
    return [Figure(f"{VIEWERS:,} viewers join from one address: all LIVE after", last_s, IN_MAX_S, "s")]
