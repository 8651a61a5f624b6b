"""`python -m posecast_loadtests.soak`: half an hour of viewers coming and going, and what they leave behind.

It runs a relay with Redis, the demo robot, Locust's viewers (a tenth leave each minute and return as new
ones; some read slowly, some stop reading), and one real page in Chromium. It reads memory, descriptors,
threads and tasks all the time, and the page's heap sixty times after a forced collection. A report goes to
`--out`. Exit status 1 if a limit was exceeded.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import shutil
import socket
import sys
import time
import urllib.request
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from subprocess import Popen, TimeoutExpired
from tempfile import TemporaryDirectory
from typing import NamedTuple

from posecast_testing import free_port, until

from posecast_loadtests.endurance import (
    BROKEN,
    FULL_MINUTES,
    NOT_SHOWN,
    RETURN_WITHIN,
    Point,
    SoakResult,
    judge_growth,
    judge_heap,
    judge_return,
    table,
)
from posecast_loadtests.page_heap import Page, PageError, page
from posecast_loadtests.results import LoadLimits, Tally, breaches
from posecast_loadtests.scenarios import SOAK
from posecast_loadtests.stage import OwnRelay, ends_on_term, own_relay, started

_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
_ANSWER_S = 10.0
READINGS = 360  # per run, at most one a second
WARM = 6  # everything is warm after a sixth of the run
HEAP_READINGS = 60  # roughly
REST_S = 30.0  # within this time everything that the load opened must be closed
LIVE_S = 30.0
GROWING = ("relay RSS", "edge RSS", "Redis")
POOL = min(32, (os.cpu_count() or 1) + 4)  # Python's thread pool: threads are made on demand, then kept
BEFORE, AFTER = "before: ", "after: "  # readings at rest
RETURNING = ("relay descriptors", "relay threads", "relay tasks", "edge descriptors", "edge threads")
HEAP = "page heap"
FAILED = "readings without an answer"
# reasons why viewers left; how often Redis was lost
TOLD = ("posecast_endings_total{", "posecast_store_losses_total ")


class Vitals(NamedTuple):
    """The resources of one process at one time."""

    rss_mb: float  # resident, 10⁶ bytes
    descriptors: int
    threads: int


def vitals(pid: int) -> Vitals:
    """Read a process. Raises FileNotFoundError or ProcessLookupError if it is gone."""
    at = Path(f"/proc/{pid}")
    pages = int((at / "statm").read_text().split()[1])
    threads = len(os.listdir(at / "task"))
    return Vitals(pages * _PAGE_BYTES / 1e6, len(os.listdir(at / "fd")), threads)


def redis_mb(port: int) -> float:
    """Read how much Redis has allocated (`used_memory`). Raises OSError or ValueError if it does not
    answer."""
    with socket.create_connection(("127.0.0.1", port), _ANSWER_S) as link:
        link.sendall(b"INFO memory\r\n")
        heard = b""
        while b"maxmemory:" not in heard:
            more = link.recv(65536)
            if not more:
                break
            heard += more
    found = re.search(rb"^used_memory:(\d+)", heard, re.MULTILINE)
    if found is None:
        raise ValueError("redis: no used_memory in its answer to INFO memory")
    return int(found[1]) / 1e6


def gauge(metrics: str, name: str) -> float:
    """Read one value of a relay's metrics. Raises OSError or ValueError if it is missing."""
    found = figures(metrics, f"{name} ")
    if not found:
        raise ValueError(f"{metrics}: no {name}")
    return next(iter(found.values()))


def figures(metrics: str, *beginnings: str) -> dict[str, float]:
    """Read all metrics whose lines begin so, with their labels. Raises OSError if there is no answer."""
    with urllib.request.urlopen(metrics, timeout=_ANSWER_S) as answer:
        lines = answer.read().decode().splitlines()
    found = (line.rpartition(" ") for line in lines if line.startswith(beginnings))
    return {name: float(value) for name, _, value in found}


def options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m posecast_loadtests.soak", description=(__doc__ or "").partition(":")[2].split(".")[0]
    )
    parser.add_argument(
        "--minutes", type=float, default=FULL_MINUTES, help="length of the test [30]; 480 for a night"
    )
    parser.add_argument("--viewers", type=int, default=SOAK.viewers)
    parser.add_argument("--static", type=Path, default=Path("spa/dist"), help="the built page")
    parser.add_argument("--no-page", action="store_true", help="run without a page in Chromium")
    parser.add_argument("--out", type=Path, default=Path("out/soak"))
    asked = parser.parse_args()
    if asked.minutes <= 0 or asked.viewers < 1:
        parser.error("--minutes and --viewers must be above 0")
    if not asked.no_page and not (asked.static / "index.html").is_file():
        parser.error(f"--static {asked.static}: contains no built page: run `make setup`, or use --no-page")
    return asked


@dataclass
class Record:
    """The readings, with their times."""

    began_s: float = field(default_factory=time.monotonic)
    series: dict[str, list[Point]] = field(default_factory=dict)
    told: dict[str, float] = field(default_factory=dict)  # the relay's counters at the end, see TOLD

    def note(self, name: str, value: float) -> None:
        """Record a reading now."""
        self.series.setdefault(name, []).append(Point(time.monotonic() - self.began_s, value))

    def newest(self, name: str) -> float:
        """Return the last reading."""
        return self.series[name][-1].value

    def warm(self, name: str, from_s: float) -> list[Point]:
        """Return a series without its warm-up."""
        return [point for point in self.series.get(name, []) if point.at_s >= from_s]


def redis(stack: ExitStack, folder: Path, port: int) -> None:
    """Start Redis without persistence."""
    started(
        stack, folder, "redis", "redis-server", *("--port", str(port), "--bind", "127.0.0.1"),
        *("--save", "", "--appendonly", "no", "--logfile", "/dev/null"),
    )  # fmt: skip

    def answers() -> bool:
        with suppress(OSError, ValueError):
            return redis_mb(port) > 0
        return False

    until("redis-server answers", answers)


def viewers(asked: argparse.Namespace, stack: ExitStack, host: str, counts: Path) -> Popen[bytes]:
    """Start Locust for the length of the soak."""
    command = [
        *(sys.executable, "-m", "locust", "-f", str(Path(__file__).with_name("scenario_file.py"))),
        *("--headless", "--only-summary", "--loglevel", "WARNING", "--scenario", SOAK.name, "-H", host),
        *("--stretch", str(asked.minutes / FULL_MINUTES), "--viewers", str(asked.viewers)),
        *("--counts", str(counts)),
    ]
    return started(stack, asked.out, "locust", *command).process


def look_whole(shown: Page) -> None:
    """Raise AssertionError if the page does not show the robot, or does not say LIVE."""
    until("the page shows the robot", lambda: shown.view() != "", LIVE_S)
    until("the page says LIVE", lambda: "LIVE" in shown.text(), LIVE_S)


class Readers:
    """Reads the resources that relay, edge and Redis use."""

    def __init__(self, record: Record, own: OwnRelay, metrics: str, redis_port: int) -> None:
        self._record = record
        self._own = own
        self._metrics = metrics
        self._redis_port = redis_port

    def read(self, prefix: str = "") -> None:
        """Read each series once; `prefix` is prepended to its name.

        Raises SystemExit if a process has ended, OSError or ValueError if one does not answer in time.
        """
        note = self._record.note
        for name, process in (("relay", self._own.relay.process), ("edge", self._own.edge.process)):
            if process.poll() is not None:
                sys.exit(f"soak: the {name} has ended with {process.returncode}")
            rss_mb, descriptors, threads = vitals(process.pid)
            note(f"{prefix}{name} RSS", rss_mb)
            note(f"{prefix}{name} descriptors", descriptors)
            note(f"{prefix}{name} threads", threads)
        note(f"{prefix}relay tasks", gauge(self._metrics, "posecast_tasks"))
        note(f"{prefix}Redis", redis_mb(self._redis_port))

    def read_at_rest(self) -> None:
        """Read once everything is back to its initial state, or after a limit."""
        end_s = time.monotonic() + REST_S
        while True:
            self.read(AFTER)
            back = all(
                abs(self._record.newest(AFTER + n) - self._record.newest(BEFORE + n)) <= 1 for n in RETURNING
            )
            if back or time.monotonic() > end_s:
                return
            time.sleep(0.5)


def watch(
    record: Record, readers: Readers, process: Popen[bytes], shown: Page | None, seconds: float
) -> None:
    """Take readings until Locust ends."""
    record.began_s, next_heap_s = time.monotonic(), seconds / WARM
    while process.poll() is None:
        try:
            readers.read()
        except (OSError, ValueError):  # one timeout must not end a test of a whole night
            record.note(FAILED, 1)
        at_s = time.monotonic() - record.began_s
        if shown is not None and at_s >= next_heap_s:
            next_heap_s += seconds / HEAP_READINGS
            look_whole(shown)
            scripts_mb, browser_mb = shown.heap()
            record.note(f"{HEAP}, {shown.view()}", scripts_mb)
            record.note("kept by the browser for the page", browser_mb)
        with suppress(TimeoutExpired):
            process.wait(max(1.0, seconds / READINGS))


def soak(asked: argparse.Namespace, chromium: str | None) -> tuple[Record, Tally]:
    """Run the whole test. `chromium`: the program; None: no page."""
    record, metrics_port, redis_port = Record(), free_port(), free_port()
    counts: Path = asked.out / "counts.json"
    counts.unlink(missing_ok=True)
    with ExitStack() as stack:
        redis(stack, asked.out, redis_port)
        flags = ["--store", f"redis://127.0.0.1:{redis_port}/0", "--metrics-port", str(metrics_port)]
        if chromium is not None:
            flags += ["--static", str(asked.static)]
        own = own_relay(stack, asked.out, *flags)
        readers = Readers(record, own, f"http://127.0.0.1:{metrics_port}/metrics", redis_port)
        readers.read(BEFORE)
        with ExitStack() as load:
            shown: Page | None = None
            if chromium is not None:
                profile = load.enter_context(TemporaryDirectory(prefix="posecast-soak-"))
                address = own.address.viewers.replace("ws://", "http://") + "/#/r/demo"
                shown = load.enter_context(page(chromium, address, profile, asked.out))
                look_whole(shown)
            process = viewers(asked, load, own.address.viewers, counts)
            watch(record, readers, process, shown, asked.minutes * 60)
        if process.returncode or not counts.exists():
            sys.exit(f"soak: Locust ended with {process.returncode}, see {asked.out}")
        readers.read_at_rest()
        record.told = figures(f"http://127.0.0.1:{metrics_port}/metrics", *TOLD)
    return record, Tally.sum([json.loads(counts.read_text())])


def judge(record: Record, minutes: float, no_page: str) -> list[SoakResult]:
    """Judge the readings against the limits. `no_page`: why there was no page."""
    warm_s = minutes * 60 / WARM
    found = [judge_growth(name, record.warm(name, warm_s), minutes) for name in GROWING]
    for name in RETURNING:
        within = RETURN_WITHIN + (POOL if name.endswith("threads") else 0)
        found.append(judge_return(name, record.newest(BEFORE + name), record.newest(AFTER + name), within))
    if no_page:
        return [*found, SoakResult(HEAP, no_page, "", NOT_SHOWN)]
    # the 3D view and the light view need different amounts of memory, so judge each alone
    heaps = [name for name in record.series if name.startswith(HEAP)] or [HEAP]
    return found + [judge_heap(name, record.series.get(name, []), minutes) for name in heaps]


def main() -> int:
    asked = options()
    ends_on_term()
    asked.out.mkdir(parents=True, exist_ok=True)
    short = "" if asked.minutes >= FULL_MINUTES else f" (the limits are for {FULL_MINUTES:g})"
    crowd = f"{asked.viewers} viewers × {SOAK.hz:g} Hz, {SOAK.churn_per_min:.0%} of them new each minute"
    print(f"soak: {asked.minutes:g} minutes{short}; {crowd}", flush=True)
    chromium = None if asked.no_page else shutil.which("chromium")
    no_page = "" if chromium else "not asked for" if asked.no_page else "no chromium here"
    try:
        record, tally = soak(asked, chromium)
    except (AssertionError, PageError) as e:
        sys.exit(f"soak: {e}, see {asked.out}")
    findings = judge(record, asked.minutes, no_page)
    # a busy machine may be late and lower rates, but must never break the other limits
    never = breaches(replace(tally, lowered=0), LoadLimits(missed_share=1.0, p99_ms=float("inf"), jain=0.0))
    print(table(findings))
    print(f"{tally.frames} frames to viewers, {tally.missed} missed; {tally.evicted} frozen viewers cut")
    print("the relay says", ", ".join(f"{name} {value:.0f}" for name, value in record.told.items()))
    if FAILED in record.series:
        print(f"{len(record.series[FAILED])} {FAILED}")
    for line in never:
        print(f"BREACH  {line}")
    report = {
        "minutes": asked.minutes,
        "viewers": asked.viewers,
        "machine": {"kernel": platform.release(), "cores": os.cpu_count(), "load": os.getloadavg()},
        "findings": [asdict(finding) for finding in findings],
        "breaches": never,
        "counts": tally.counts(),
        "told": record.told,
        "series": record.series,
    }
    (asked.out / "soak.json").write_text(json.dumps(report, indent=1) + "\n")
    print(f"all readings: {asked.out}/soak.json")
    return 1 if never or any(finding.verdict == BROKEN for finding in findings) else 0


if __name__ == "__main__":
    sys.exit(main())
