"""The relay's fan-out beside a bare send() loop, websockets.broadcast() and a FastAPI loop (`make bench`).

One sitting, rounds interleaved: every server meets the same neighbours, and ratios are taken within a round.
The server has one core, the viewers (C) and the robot another. Main figure: CPU of the server per delivered
binary message (/proc/PID/task/*/schedstat, all threads, Zenoh's too); wall rates suffer from neighbours, this
less. "core/others": the server's share of its core, and the most that neighbours took of it: when a figure
looks odd, look there first. "relay-write" is the relay without io_uring. Writes out/bench/bench.json.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from relay.benches.build import OUT, ROOT, NoCompiler, build
from relay.benches.measure import Row, measure
from relay.benches.scenarios import ALL, QUICK, RELAYS, SCENARIOS, Scenario
from relay.benches.servers import CannotStart, Place
from relay.benches.table import goals, print_all

QUICK_S = 3.0
TRIES = 3
DISTURBED = 0.1  # of the wall time another process had the server's core


def parse(names: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="bench", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("scenario", nargs="*", help=f"of {', '.join(names)}; all when none is named")
    parser.add_argument(
        "--quick", action="store_true", help=f"one round of 3 s, {' and '.join(QUICK)}: about a minute"
    )
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--servers", default=",".join({*ALL, *RELAYS}), help="a ratio needs both its servers")
    parser.add_argument("--out", type=Path, default=OUT)
    asked = parser.parse_args()
    unknown = [name for name in asked.scenario if name not in names]
    if unknown:
        parser.error(f"no scenario {unknown[0]!r}: use {', '.join(names)}")
    return asked


def choose_cores() -> tuple[int, int]:
    cores = sorted(os.sched_getaffinity(0))
    if len(cores) == 1:
        print(
            "bench: one core here for server and viewers: no latency below counts",
            file=sys.stderr,
        )
    return cores[0], cores[-1]


def prepare(out: Path) -> Place:
    """Programs built, files allowed, this process on the core that is not the server's. NoCompiler."""
    binaries = build()
    resource.setrlimit(resource.RLIMIT_NOFILE, (resource.getrlimit(resource.RLIMIT_NOFILE)[1],) * 2)
    out.mkdir(parents=True, exist_ok=True)
    server_core, other_core = choose_cores()
    os.sched_setaffinity(0, {other_core})
    return Place(server_core, other_core, binaries, out)


def commit() -> str:
    """What is measured; `+`: with changes that are not committed."""
    said: list[str] = []
    for command in (("rev-parse", "--short", "HEAD"), ("status", "--porcelain", "--untracked-files=no")):
        try:
            done = subprocess.run(("git", *command), cwd=ROOT, capture_output=True, text=True, check=True)
        except (FileNotFoundError, subprocess.CalledProcessError):  # sources without their history
            return "unknown"
        said.append(done.stdout.strip())
    return said[0] + ("+" if said[1] else "")


def machine() -> dict[str, object]:
    """Where and when it was measured."""
    found = re.search(r"^model name\s*: (.+)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    return {
        "day": time.strftime("%d %B %Y").lstrip("0"),
        "commit": commit(),
        "kernel": ".".join(platform.release().split(".")[:2]),
        "python": platform.python_version(),
        "cpu": found[1] if found else platform.machine(),
        "cores": os.cpu_count(),
        "load_average_before": os.getloadavg()[0],
    }


def progress(text: str) -> None:
    """One line that the next one replaces."""
    if sys.stderr.isatty():
        print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)


def calmest(run_once: Callable[[], Row], tries: int) -> Row:
    """One run; when a neighbour had the server's core for long, another, and the least disturbed counts."""
    best: Row | None = None
    for _ in range(tries):
        row = run_once()
        if best is None or row["others_share"] < best["others_share"]:
            best = row
        if best["others_share"] < DISTURBED:
            break
    assert best is not None
    return best


def run(chosen: list[Scenario], servers: list[str], rounds: int, place: Place, quick: bool) -> list[Row]:
    rows: list[Row] = []
    for number in range(rounds):
        for scenario in chosen:
            asked = [s for s in scenario.servers if s in servers]
            first = number % len(asked) if asked else 0
            for kind in asked[first:] + asked[:first]:
                progress(f"round {number + 1}/{rounds}: {scenario.title}, {kind}")
                seconds, tries = (QUICK_S, 1) if quick else (scenario.seconds, TRIES)
                try:
                    row = calmest(partial(measure, kind, scenario, place, seconds), tries)
                    rows.append(row | {"round": number})
                except CannotStart as e:
                    progress("")
                    print(f"bench: {scenario.name}, {kind}: {e}", file=sys.stderr)
    progress("")
    return rows


def main() -> int:
    by_name = {s.name: s for s in SCENARIOS}
    asked = parse(list(by_name))
    names = asked.scenario or (QUICK if asked.quick else list(by_name))
    try:
        place = prepare(asked.out)
    except NoCompiler as e:
        print(e, file=sys.stderr)
        return 2
    about, began = machine(), time.monotonic()
    rounds = 1 if asked.quick else asked.rounds
    rows = run([by_name[n] for n in names], asked.servers.split(","), rounds, place, asked.quick)
    print_all(rows)
    about |= {"load_average_after": os.getloadavg()[0], "took_s": round(time.monotonic() - began)}
    loads = f"{about['load_average_before']:.1f} before, {about['load_average_after']:.1f} after"
    print(f"\nload average {loads}; {about['took_s']} s")
    reached = {g.name: {"limit": g.limit, "values": g.values, "reached": g.reached} for g in goals(rows)}
    report = {"machine": about, "goals": reached, "runs": rows}
    (asked.out / "bench.json").write_text(json.dumps(report, indent=1) + "\n")
    print(f"all figures: {asked.out / 'bench.json'}")
    return 0 if rows else 1


if __name__ == "__main__":
    sys.exit(main())
