"""The lane under load: segments through nginx and Varnish to 100, 1,000 and 5,000 viewers each (`make lane`).

One sitting: both nodes stand before one origin and are read at the same time. The relay has one core; the
robot, the nodes and the viewers (relay/benches/viewers.c) share another. In each round: the origin
alone, then each crowd; afterwards each crowd through a pause of the robot and a new run. Says on stderr what
it is at. Exit status 0: all goals were reached; 1: one was missed, as happens on a busy machine; 2: it could
not run. Writes out/lane/lane.json; `--write` also the tables and plots of docs/reference/benchmarks.md, and
measured.json here, on which other arithmetic stands.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

from relay.benches.bench import machine, prepare
from relay.benches.build import ROOT, NoCompiler
from relay.benches.lane.caches import CACHES
from relay.benches.lane.measure import (
    SHORT,
    LanePlan,
    measure_bytes,
    measure_idle,
    measure_steady,
    measure_trouble,
)
from relay.benches.lane.robot import read_feed
from relay.benches.lane.stage import LaneStage, Row, set_stage
from relay.benches.lane.table import (
    find_goals,
    list_caches,
    list_crowds,
    make_bytes,
    make_goals,
    make_steady,
    make_trouble,
    pick,
    request_ms,
)
from relay.benches.servers import CannotStart, Place
from relay.benches.stamps import make_stamps
from tools import bars, scaling
from tools.pages import fill

OUT = ROOT / "out" / "lane"
MEASURED = Path(__file__).with_name("measured.json")
SCENARIOS = ("steady", "trouble", "bytes")


def options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="lane", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("scenario", nargs="*", help=f"of {', '.join(SCENARIOS)}; all when none is named")
    parser.add_argument("--short", action="store_true", help="100 and 1,000, one round: three minutes")
    parser.add_argument("--caches", default=",".join(CACHES), help=f"of {', '.join(CACHES)}")
    parser.add_argument("--viewers", help="crowds, as 100,1000,5000")
    parser.add_argument("--rounds", type=int)
    parser.add_argument(
        "--write", action="store_true", help="into docs/reference/benchmarks.md and measured.json"
    )
    parser.add_argument("--again", type=Path, metavar="FILE", help="a lane.json: its tables, nothing is run")
    parser.add_argument("--out", type=Path, default=OUT)
    asked = parser.parse_args()
    for name, known in ((n, SCENARIOS) for n in asked.scenario):
        if name not in known:
            parser.error(f"no scenario {name!r}: use {', '.join(known)}")
    for name in asked.caches.split(","):
        if name not in CACHES:
            parser.error(f"no cache {name!r}: use {', '.join(CACHES)}")
    return asked


def make_plan(asked: argparse.Namespace) -> LanePlan:
    """How much of it is asked for."""
    plan = SHORT if asked.short else LanePlan()
    crowds = tuple(int(n) for n in asked.viewers.split(",")) if asked.viewers else plan.crowds
    rounds = asked.rounds or plan.rounds
    return LanePlan(crowds, rounds, plan.window_s, plan.pause_s, plan.after_s, plan.bytes_s)


def tell(text: str) -> None:
    """One line of progress."""
    print(f"{time.strftime('%H:%M:%S')} {text}", file=sys.stderr, flush=True)


def play(stage: LaneStage, place: Place, plan: LanePlan, scenarios: tuple[str, ...]) -> Iterator[Row]:
    """All rows, as they come. CannotStart."""
    if "bytes" in scenarios:
        tell(f"bytes of the lane and of WebSockets, {plan.bytes_s:.0f} s")
        yield from measure_bytes(stage, place, plan.bytes_s)
    for number in range(plan.rounds if "steady" in scenarios else 0):
        tell(f"round {number + 1}/{plan.rounds}: nobody watches")
        idle_ms = measure_idle(stage, plan.window_s)
        shift = number % len(plan.crowds)
        for viewers in plan.crowds[shift:] + plan.crowds[:shift]:
            tell(f"round {number + 1}/{plan.rounds}: {viewers:,} viewers of each node")
            for row in measure_steady(stage, place, viewers, plan.window_s):
                yield row | {"round": number, "idle_ms": idle_ms}
    for viewers in plan.crowds if "trouble" in scenarios else ():
        tell(f"{viewers:,} viewers of each node, a pause and a new run")
        yield from measure_trouble(stage, place, viewers, plan)


def sum_up(rows: list[Row], about: dict[str, Any]) -> dict[str, Any]:
    """What arithmetic elsewhere stands on: bytes a second, and each answer's headers and body."""
    live = pick(rows, scenario="bytes", cache="WebSocket")[0]
    lane = [row for row in pick(rows, scenario="bytes") if row["cache"] != "WebSocket"]
    steady = [row for row in pick(rows, scenario="steady") if row["viewers"] == list_crowds(rows)[-1]]
    return {
        "machine": about,
        "hz": 30,
        "websocket_bytes_s": round(live["bytes_s"]),
        "frame_bytes": round(live["bytes"] / live["messages"], 1),
        "lane_bytes_s": {row["cache"]: round(row["bytes_s"]) for row in lane},
        "segment_bytes": round(lane[0]["segment_bodies"] / lane[0]["segments"]),
        "header_bytes": {row["cache"]: round(row["segment_heads"] / row["segments"]) for row in lane},
        "behind_p95_s": {
            cache: round(median(row["age_ms"]["p95"] for row in pick(steady, cache=cache)) / 1e3, 2)
            for cache in list_caches(rows)
        },
        "origin_cpu_ms_a_segment": round(median(map(request_ms, steady)), 2),
    }


def measure(asked: argparse.Namespace) -> dict[str, Any]:
    """Run it: the machine, and all rows. CannotStart, NoCompiler."""
    plan, about, began = make_plan(asked), machine(), time.monotonic()
    signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))  # ends what it has started
    place = prepare(asked.out)
    make_stamps(place.stamps)
    with set_stage(place, asked.caches.split(",")) as stage:
        rows = list(play(stage, place, plan, tuple(asked.scenario) or SCENARIOS))
    about |= {"feed": read_feed()[0], "load_average_after": os.getloadavg()[0]}
    about["took_s"] = round(time.monotonic() - began)
    found = {"machine": about, "rows": rows}
    (asked.out / "lane.json").write_text(json.dumps(found, indent=1) + "\n")
    return found


def main() -> int:
    asked = options()
    try:
        found = json.loads(asked.again.read_text()) if asked.again else measure(asked)
    except (CannotStart, NoCompiler) as e:
        print(f"lane: {e}", file=sys.stderr)
        return 2
    rows, about = found["rows"], found["machine"]
    makers = {"steady": make_steady, "pause": make_trouble, "bytes": make_bytes}
    blocks = {f"lane-{name}": make(rows) for name, make in makers.items() if pick(rows, scenario=name)}
    goals = find_goals(rows)
    blocks["lane-goals"] = make_goals(goals)
    for block in blocks.values():
        print(f"\n{block}")
    loads = f"{about['load_average_before']:.1f} before, {about['load_average_after']:.1f} after"
    print(f"\nload average {loads}; {about['took_s']} s; feed: {about['feed']}")
    if asked.write:
        bars.PAGE.write_text(fill(bars.PAGE.read_text(), blocks, bars.PAGE.name))
        bars.draw()
        MEASURED.write_text(json.dumps(sum_up(rows, about), indent=1) + "\n")
        scaling.write(ROOT / "docs")
    missed = sum(not goal.reached for goal in goals)
    if missed:
        print(
            f"lane: {missed} of {len(goals)} goals missed; a busy machine misses those of time",
            file=sys.stderr,
        )
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
