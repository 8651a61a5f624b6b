"""How many viewers a relay of one worker serves, and one of two, at the same lateness of frames.

A machine of two cores can't give two workers a core each and the viewers another. So each worker gets an
equal *part* of a core (--share, a quarter): a control group of its own, whose quota is given out anew every
10 ms. What counts is a ratio within one run: the most viewers whose frames' p99 of lateness is within --bound
and who get nearly all (97 %) of their frames. The two relays are tried in turns, each on a ladder of its own,
so that they have the same neighbours; the groups come before whatever else runs here. Needs root, and cc.

    python -m relay.benches.workers [--rounds 3] [--workers 2] [--share 0.25] [--hz 30] [--bound 100]

Writes out/bench/workers.json; with `--write` also the table of docs/reference/benchmarks.md, with `--rounds
0 --write` that of the last report.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from subprocess import PIPE, Popen
from typing import Any

from relay.benches.bench import machine
from relay.benches.build import OUT, NoCompiler, build
from relay.benches.lane.page import PAGE, fill, markdown
from relay.benches.servers import ROBOT, CannotStart, end, wait_line
from relay.benches.stamps import make_stamps

GROUPS = Path("/sys/fs/cgroup")
PERIOD_US = 10_000  # a quota is 1 ms at least
DELIVERED = 0.97  # of the frames that were due
STEP = 1.04  # of the ladder
RUN_S = 5.0
SAMPLE_S = 0.1
REPORT = OUT / "workers.json"
HEAD = ["round", "1 worker", "{} workers", "ratio", "µs CPU per frame: 1 worker", "{} workers", "load"]
START_AT = 2400  # viewers of one worker with a whole core at 30 Hz, as a first guess


class NoGroups(Exception):
    """One line for people."""


class Group:
    """A control group (v1 or v2) with a part of a core; None: all it wants, before others."""

    def __init__(self, name: str, share: float | None) -> None:
        is_v1 = (GROUPS / "cpu" / "cpu.shares").exists()
        self._path = GROUPS / "cpu" / name if is_v1 else GROUPS / name
        quota = -1 if share is None else round(PERIOD_US * share)
        v1 = {"cpu.cfs_period_us": PERIOD_US, "cpu.cfs_quota_us": quota, "cpu.shares": 200_000}
        v2 = {"cpu.max": f"{'max' if share is None else quota} {PERIOD_US}", "cpu.weight": 10_000}
        try:
            self._path.mkdir(exist_ok=True)
            for file, value in (v1 if is_v1 else v2).items():
                (self._path / file).write_text(f"{value}\n")
        except OSError as e:
            raise NoGroups(f"workers: control groups can't be made here: {e}") from None

    def add(self, pid: int) -> None:
        """Move a process here."""
        (self._path / "cgroup.procs").write_text(f"{pid}\n")

    def remove(self) -> None:
        """Once nothing is in it."""
        with suppress(OSError):
            self._path.rmdir()


@dataclass
class Bench:
    """What all runs share."""

    binaries: dict[str, Path]
    groups: list[Group]  # of workers
    others: Group  # of the robot and the viewers
    hz: float
    bound_ms: float

    @property
    def stamps(self) -> Path:
        """When each frame was made."""
        return OUT / "stamps"


@contextmanager
def relay_of(workers: int, bench: Bench) -> Iterator[tuple[int, list[int]]]:
    """A relay and its robot: its port, and the processes that serve."""
    make_stamps(bench.stamps)
    settings = ["run", "--dev", "--port", "0", "--zenoh-listen", "tcp/127.0.0.1:0", "--past", "0"]
    settings += ["--workers", str(workers), "--max-viewers", "100000"]
    robot: Popen[bytes] | None = None
    with open(OUT / "server.log", "ab") as log:
        program = str(Path(sys.executable).with_name("posecast-relay"))
        child = Popen([program, *settings], stdout=PIPE, stderr=log)
        try:
            said = wait_line(child, r"serving http://[^ ]*:(\d+), robots on (\S+)\s")
            further = Path(f"/proc/{child.pid}/task/{child.pid}/children").read_text().split()
            pids = [child.pid, *map(int, further)]
            publisher = [
                sys.executable,
                "-m",
                "relay.benches.publisher",
                "--relay",
                said[2],
                "--robot",
                ROBOT,
            ]
            publisher += ["--hz", f"{bench.hz:g}", "--stamps", str(bench.stamps), "--bytes", "200"]
            robot = Popen(publisher, stdout=PIPE, stderr=log)
            wait_line(robot, "READY\n")
            bench.others.add(robot.pid)
            for pid, group in zip(pids, bench.groups, strict=False):
                group.add(pid)
            yield int(said[1]), pids
        finally:
            end(child)
            if robot is not None:
                end(robot)


class CpuWatch:
    """Seconds of CPU of some processes, and when."""

    def __init__(self, pids: list[int]) -> None:
        self._pids = pids
        self._samples: list[tuple[float, list[float]]] = []
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def _watch(self) -> None:
        while not self._ends.wait(SAMPLE_S):
            self._samples.append((time.monotonic(), [cpu_s(pid) for pid in self._pids]))

    def stop(self, from_s: float, to_s: float) -> list[float]:
        """What each used within this time."""
        self._ends.set()
        self._thread.join()
        within = [used for at, used in self._samples if from_s <= at <= to_s] or [[0.0] * len(self._pids)]
        return [b - a for a, b in zip(within[0], within[-1], strict=True)]


def cpu_s(pid: int) -> float:
    """All threads."""
    found = 0
    for task in Path(f"/proc/{pid}/task").iterdir():
        with suppress(OSError):
            found += int((task / "schedstat").read_text().split()[0])
    return found / 1e9


def play(workers: int, viewers: int, bench: Bench) -> dict[str, Any]:
    """One run: so many viewers at a relay of so many workers."""
    with relay_of(workers, bench) as (port, pids):
        asked: dict[str, object] = {
            "--port": port,
            "--path": f"/api/v1/robots/{ROBOT}/live?hz={bench.hz:g}",
            "--viewers": viewers,
            "--stamps": bench.stamps,
            "--mode": "steady",
            "--seconds": RUN_S,
            "--server-pid": pids[0],
            "--server-core": 0,
        }
        command = [str(bench.binaries["viewers"]), *(str(part) for pair in asked.items() for part in pair)]
        watch, child = CpuWatch(pids), Popen(command, stdout=PIPE, text=True)
        bench.others.add(child.pid)
        said, _ = child.communicate(timeout=120)
        row: dict[str, Any] = json.loads(said)
        began_s = row["window_began_s"]
        used = watch.stop(began_s, began_s + row["wall_s"])
    due = row["wall_s"] * bench.hz * viewers
    p99, delivered = row["lateness_ms"]["p99"], row["messages"] / due
    fits = p99 <= bench.bound_ms and delivered >= DELIVERED and not row["failed"]
    shares = [round(each / row["wall_s"], 3) for each in used]
    return {
        "workers": workers,
        "viewers": viewers,
        "p99_ms": p99,
        "delivered": round(delivered, 4),
        "cpu_us": sum(used) * 1e6 / max(1, row["messages"]),
        "shares": shares,
        "fits": fits,
        "generator_share": row["generator_share"],
        "load_average": os.getloadavg()[0],
    }


class Ladder:
    """Finds the most viewers that fit, from a first guess, in steps that become finer."""

    def __init__(self, guess: int) -> None:
        self.at = guess
        self.fits: int | None = None
        self.too_many: int | None = None

    @property
    def is_done(self) -> bool:
        """Whether the next step would be less than STEP."""
        return self.fits is not None and self.too_many is not None and self.too_many <= self.fits * STEP

    def record(self, fits: bool) -> None:
        """How it went at `at`; it moves on."""
        if fits:
            self.fits = self.at
        else:
            self.too_many = self.at
        if self.fits is None:
            self.at = round(self.at / 1.25)
        elif self.too_many is None:
            self.at = round(self.at * 1.25)
        else:
            self.at = round((self.fits * self.too_many) ** 0.5)


def search(sizes: tuple[int, int], guess: int, bench: Bench, rows: list[dict[str, Any]]) -> dict[int, int]:
    """The most viewers of each of the two relays, tried in turns."""
    ladders = {size: Ladder(guess * size) for size in sizes}
    while not all(ladder.is_done for ladder in ladders.values()):
        for size, ladder in ladders.items():
            if ladder.is_done:
                continue
            try:
                row = play(size, ladder.at, bench)
            except CannotStart as e:
                print(f"workers: {e}", file=sys.stderr)
                continue
            rows.append(row)
            shares = ", ".join(f"{share:.2f}" for share in row["shares"])
            seen = f"p99 {row['p99_ms']:7.1f} ms, {row['delivered']:.1%} of the frames"
            cost = f"{row['cpu_us']:.2f} µs of CPU each; shares of a core {shares}"
            print(f"  {size} × {row['viewers']:5} viewers: {seen}, {cost}", flush=True)
            ladder.record(row["fits"])
    return {size: ladder.fits or 0 for size, ladder in ladders.items()}


def make_block(report: dict[str, Any]) -> str:
    """The table of a report, as Markdown, and how it was measured."""
    asked, about, lines = report["asked"], report["machine"], []
    sizes = (1, asked["workers"])
    for number, found in enumerate(report["found"], 1):
        tried = [row for row in report["runs"] if row["round"] == number]
        most = [found[str(size)] for size in sizes]
        cpu = [statistics.median(row["cpu_us"] for row in tried if row["workers"] == size) for size in sizes]
        loads = [row["load_average"] for row in tried]
        line = [f"{number}", *(f"{each:,}" for each in most), f"{most[1] / most[0]:.2f}" if most[0] else "–"]
        lines.append([*line, *(f"{each:.1f}" for each in cpu), f"{min(loads):.0f} to {max(loads):.0f}"])
    how = (
        f"The most viewers at {asked['hz']:g} Hz with p99 lateness within {asked['bound']:g} ms, "
        f"{asked['share']:g} of a core for each worker. Rounds: {len(lines)}; median ratio: "
        f"{statistics.median(report['ratios']):.2f}. {about['day']}, {about['cores']} cores ({about['cpu']})."
    )
    return f"{markdown([each.format(sizes[1]) for each in HEAD], lines)}\n\n{how}"


def write_page() -> None:
    """Put the table of the last report into docs/reference/benchmarks.md."""
    PAGE.write_text(fill(PAGE.read_text(), {"workers": make_block(json.loads(REPORT.read_text()))}))


def main() -> int:
    """As the docstring of this module says."""
    parser = argparse.ArgumentParser(prog="workers", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--share", type=float, default=0.25, help="of a core, for each worker")
    parser.add_argument("--hz", type=float, default=30.0)
    parser.add_argument("--bound", type=float, default=100.0, help="ms, of the 99th percentile of lateness")
    parser.add_argument("--write", action="store_true", help="into docs/reference/benchmarks.md")
    asked = parser.parse_args()
    if asked.rounds == 0:
        if asked.write:
            write_page()
        return 0
    groups: list[Group] = []
    try:
        binaries = build()
        groups += [Group(f"posecast-worker-{n}", asked.share) for n in range(asked.workers)]
        others = Group("posecast-viewers", None)
    except (NoCompiler, NoGroups) as e:
        print(e, file=sys.stderr)
        return 2
    bench = Bench(binaries, groups, others, asked.hz, asked.bound)
    about, rows, found = machine(), list[dict[str, Any]](), list[dict[int, int]]()
    guess = round(START_AT * asked.share * 30 / asked.hz)
    for number in range(asked.rounds):
        print(f"round {number + 1} of {asked.rounds}")
        tried: list[dict[str, Any]] = []
        found.append(search((1, asked.workers), guess, bench, tried))
        rows += [{"round": number + 1, **row} for row in tried]
        guess = found[-1][1] or guess
    for group in (*groups, others):
        group.remove()
    ratios = [each[asked.workers] / each[1] for each in found if each[1]]
    for each, ratio in zip(found, ratios, strict=False):
        print(f"1 worker {each[1]} viewers, {asked.workers} workers {each[asked.workers]}: {ratio:.2f} times")
    if ratios:
        print(f"median {statistics.median(ratios):.2f} times, at p99 within {asked.bound:g} ms")
    report = {"machine": about, "asked": vars(asked), "found": found, "ratios": ratios, "runs": rows}
    REPORT.write_text(json.dumps(report, indent=1) + "\n")
    if asked.write and ratios:
        write_page()
    return 0 if ratios else 1


if __name__ == "__main__":
    sys.exit(main())
