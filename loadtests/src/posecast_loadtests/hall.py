"""`python -m posecast_loadtests.hall`: many viewers, a relay with few places, and the relay is replaced once.

Starts a relay with `--max-viewers 50`, the demo robot and 500 viewers, of which 450 use the lane. Once every
viewer has received something, the relay is stopped and another one starts on its port. The test ends once
every viewer has received something from the new relay. No viewer may be refused. Results go to `--out`. Exit
status 1 if anything failed.
"""

from __future__ import annotations

import argparse
import json
import random
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass, field
from http.client import HTTPConnection, HTTPException, HTTPResponse
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from posecast_testing import free_port
from posecast_wire.segment import FrameRecord, SegmentError, SegmentStart, decode_segment

from posecast_loadtests.stage import ends_on_term, own_relay, started

JOINED_A_SECOND = 50
LIMIT_S = 120.0
POLL_S = 0.2
REFUSALS_KEPT = 1000
# of the lane, as the page asks (spa/src/stream/lane/)
AHEAD_S = 0.8
HELD_FROM_S = 0.3  # the relay held a request that took longer than this
RETRY_S = 1.0
ANSWER_S = 12.0
EMPTY_S = 3.0
SPREAD_S = 2.0
FAILURES_MAX = 4
BODY_MAX = 3_000_000


@dataclass
class HallViewer:
    """One viewer. Times are monotonic s; 0: nothing yet."""

    by: str = ""  # socket, or lane
    last_s: float = 0.0  # when something new last arrived
    longest_s: float = 0.0  # the longest time between two such moments

    def show(self, by: str, now_s: float) -> None:
        """Note that something new has arrived."""
        if self.last_s:
            self.longest_s = max(self.longest_s, now_s - self.last_s)
        self.by, self.last_s = by, now_s


@dataclass
class HallCounts:
    """The counts of all viewers of one process."""

    viewers: list[HallViewer] = field(default_factory=list)
    refusals: list[tuple[float, str]] = field(default_factory=list)  # the time and the message
    told_lane: int = 0  # how often a full relay named the lane
    moved: int = 0  # sockets closed by a stopping relay
    away: int = 0  # attempts while there was no relay
    begun_anew: int = 0  # segment names that the new relay did not know
    requests: int = 0
    segments: int = 0
    frames: int = 0
    repeats: int = 0
    missed: int = 0  # frames between two segments of a take
    unreadable: int = 0

    def note_refusal(self, text: str) -> None:
        """Note that a viewer was refused and had no alternative."""
        if len(self.refusals) < REFUSALS_KEPT:
            self.refusals.append((time.monotonic(), text))

    def write(self) -> dict[str, Any]:
        """Return it as plain JSON."""
        return asdict(self)

    @classmethod
    def read(cls, said: dict[str, Any]) -> HallCounts:
        """Return what `write` wrote."""
        viewers = [HallViewer(**each) for each in said["viewers"]]
        refusals = [(at_s, text) for at_s, text in said["refusals"]]
        return cls(**said | {"viewers": viewers, "refusals": refusals})

    def count_served(self, since_s: float) -> int:
        """Return how many viewers have received something new since then."""
        return sum(viewer.last_s > since_s for viewer in self.viewers)

    def count_by(self, by: str) -> int:
        """Return how many viewers received their newest data this way."""
        return sum(viewer.by == by for viewer in self.viewers)


class LaneReader:
    """Reads from `address` (http://…/past/VIEW). Calls `shown` for each segment with frames."""

    def __init__(self, address: str, counts: HallCounts, shown: Callable[[], None]) -> None:
        url = urlsplit(address)
        self._past, _, self._view = url.path.rpartition("/")
        self._http = HTTPConnection(url.hostname or "127.0.0.1", url.port or 80, timeout=ANSWER_S)
        self._counts = counts
        self._shown = shown
        self.due_s = 0.0  # when to make the next request, in monotonic s
        self._wanted: tuple[str, int] | None = None  # take and index; None: the lane's first segment
        self._seen: tuple[int, int] | None = None  # run and newest seq
        self._take_seen: int | None = None
        self._failures = 0

    @property
    def is_over(self) -> bool:
        """Whether it gave up after too many failures."""
        return self._failures >= FAILURES_MAX

    def ask(self) -> None:
        """Make one request and wait for the response."""
        asked_s, wanted = time.monotonic(), self._wanted
        below = f"?view={self._view}" if wanted is None else f"/{self._view}/{wanted[0]}/{wanted[1]}"
        try:
            self._http.request("GET", self._past + below)
            answer = self._http.getresponse()
            body = answer.read(BODY_MAX)
        except (OSError, HTTPException):
            self._counts.away += 1
            self._fail()
            return
        self._counts.requests += 1
        if answer.status == 204 and wanted is not None:
            self._failures = 0
            retry_s = int(answer.headers.get("retry-ms", "0")) / 1000
            self.due_s = time.monotonic() + max(RETRY_S, retry_s)
        elif answer.status != 200:
            self._refuse(answer)
        elif wanted is None:
            self._begin(json.loads(body))
        elif answer.headers.get("content-type") == "application/json":
            self._failures = 0
            self._wanted = _name(json.loads(body)["next"])
        else:
            self._take(body, asked_s)

    def _begin(self, said: dict[str, Any]) -> None:
        self._failures = 0
        if said["newest"] is None:
            self.due_s = time.monotonic() + EMPTY_S * random.uniform(0.5, 1.5)
        else:
            self._wanted = _name(said["newest"])

    def _take(self, body: bytes, asked_s: float) -> None:
        assert self._wanted is not None
        take, index = self._wanted
        try:
            segment = decode_segment(body)
        except SegmentError:
            segment = None
        start = None if segment is None else segment.start
        if segment is None or start is None or (f"{start.take:016x}", start.index) != self._wanted:
            self._counts.unreadable += 1
            self._fail()
            return
        self._failures = 0
        self._wanted = take, index + 1
        now_s = time.monotonic()
        if (
            now_s - asked_s > HELD_FROM_S
        ):  # it came as soon as it was there, and the next one will take as long
            self.due_s = now_s + (segment.to_ms - start.from_ms) / 1000 - AHEAD_S
        if segment.frames:
            self._check(start, segment.frames)
            self._shown()
        self._counts.segments += 1

    def _check(self, start: SegmentStart, frames: Sequence[FrameRecord]) -> None:
        """Check that no frame of a run repeats and none is missing in a take."""
        if self._seen is not None and self._seen[0] == start.run_id:
            step = frames[0].seq - self._seen[1]
            self._counts.repeats += step <= 0
            self._counts.missed += max(0, step - 1) if self._take_seen == start.take else 0
        self._seen, self._take_seen = (start.run_id, frames[-1].seq), start.take

    def _refuse(self, answer: HTTPResponse) -> None:
        if answer.status == 404:  # the name is from the old relay: restart at the lane's first segment
            self._counts.begun_anew += 1
        else:
            self._counts.note_refusal(f"lane: {answer.status} {answer.reason}")
        self._fail()

    def _fail(self) -> None:
        self._http.close()
        self._wanted = None
        self.due_s = time.monotonic() + random.uniform(0.0, SPREAD_S * 2**self._failures)
        self._failures += 1

    def close(self) -> None:
        """Close the connection. Calling it twice is fine."""
        self._http.close()


def _name(said: dict[str, Any]) -> tuple[str, int]:
    return said["take"], said["index"]


@dataclass(frozen=True)
class Replacement:
    """When a relay was told to stop, and when the next one served, in monotonic s."""

    ends_s: float
    serves_s: float

    def covers(self, at_s: float) -> bool:
        """Whether there was no relay at this time."""
        return self.ends_s <= at_s <= self.serves_s


def percentile(values: Sequence[float], share: float) -> float:
    """Return the percentile of the values for this share; 0 if there are none."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))] if ordered else 0.0


def find_breaches(counts: HallCounts, viewers: int, places: int, replaced: Replacement) -> list[str]:
    """Return one line for each failed check."""
    found: list[str] = []
    refused = [text for at_s, text in counts.refusals if not replaced.covers(at_s)]
    if refused:
        found.append(f"{len(refused)} refused, the first: {refused[0]}")
    if len(counts.viewers) != viewers:
        found.append(f"{len(counts.viewers)} viewers came, not {viewers}")
    if counts.count_served(replaced.serves_s) != viewers:
        missing = viewers - counts.count_served(replaced.serves_s)
        found.append(f"{missing} viewers received nothing after the relay was replaced")
    if counts.told_lane < viewers - places:
        found.append(f"only {counts.told_lane} were sent to the lane")
    if counts.count_by("lane") < viewers - places:
        found.append(f"only {counts.count_by('lane')} used the lane, not {viewers - places}")
    bad = {name: getattr(counts, name) for name in ("repeats", "missed", "unreadable")}
    return [*found, *(f"{count} {name}" for name, count in bad.items() if count)]


def make_report(counts: HallCounts, viewers: int, places: int, replaced: Replacement) -> str:
    """Return the report of the test."""
    lines = [
        f"viewers      {len(counts.viewers)}: {counts.count_by('socket')} by sockets, "
        f"{counts.count_by('lane')} by the lane",
        f"refused      {sum(not replaced.covers(at_s) for at_s, _ in counts.refusals)}",
        f"told a lane  {counts.told_lane} times; moved away {counts.moved}, met no relay {counts.away}, "
        f"begun anew {counts.begun_anew}",
        f"got          {counts.frames} frames, {counts.segments} segments in {counts.requests} requests; "
        f"twice {counts.repeats}, missed {counts.missed}, unreadable {counts.unreadable}",
        f"no relay     {replaced.serves_s - replaced.ends_s:.1f} s",
        f"served again {counts.count_served(replaced.serves_s)} of {viewers}",
    ]
    for by in ("socket", "lane"):
        longest = [viewer.longest_s for viewer in counts.viewers if viewer.by == by]
        spread = ", ".join(f"{percentile(longest, share):.1f}" for share in (0.5, 0.95, 1.0))
        lines.append(f"without      {by}: longest between two of what came, p50, p95, max: {spread} s")
    found = find_breaches(counts, viewers, places, replaced)
    return "\n".join([*lines, *([f"BREACH       {line}" for line in found] or ["all of it held"])])


def options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m posecast_loadtests.hall", description=(__doc__ or "").split(": ", 1)[1].split("\n")[0]
    )
    parser.add_argument("--viewers", type=int, default=500)
    parser.add_argument("--places", type=int, default=50, help="the relay's --max-viewers")
    parser.add_argument("--out", type=Path, default=Path("out/load"))
    asked = parser.parse_args()
    if not 0 < asked.places < asked.viewers:
        parser.error("--viewers must be more than --places, and both above 0")
    return asked


def wait_for(file: Path, holds: Callable[[HallCounts], bool]) -> HallCounts:
    """Return the counts once `holds` is true, or the current ones after LIMIT_S."""
    end_s, counts = time.monotonic() + LIMIT_S, HallCounts()
    while time.monotonic() < end_s:
        with suppress(FileNotFoundError):
            counts = HallCounts.read(json.loads(file.read_text()))
            if holds(counts):
                break
        time.sleep(POLL_S)
    return counts


def play(viewers: int, places: int, out: Path) -> tuple[HallCounts, Replacement]:
    """Run the test. Return what the viewers saw, and when there was no relay."""
    out.mkdir(parents=True, exist_ok=True)
    file = out / "hall-counts.json"
    file.unlink(missing_ok=True)
    ports = ["--port", f"{free_port()}", "--zenoh-listen", f"tcp/127.0.0.1:{free_port()}"]
    flags = [*ports, "--max-viewers", f"{places}", "--past", "memory:"]
    with ExitStack() as stack:
        own = own_relay(stack, out / "hall", *flags)
        locust = [sys.executable, "-m", "locust", "-f", str(Path(__file__).with_name("hall_file.py"))]
        locust += ["--headless", "--only-summary", "--loglevel", "WARNING", "-H", own.address.viewers]
        locust += ["-u", f"{viewers}", "-r", f"{JOINED_A_SECOND}", "--counts", str(file)]
        crowd = started(stack, out / "hall", "locust", *locust)
        wait_for(file, lambda counts: counts.count_served(0.0) >= viewers)
        ends_s = time.monotonic()
        own.relay.process.send_signal(signal.SIGTERM)
        own.relay.process.wait(LIMIT_S)
        command = [str(Path(sys.executable).with_name("posecast-relay")), "run", "--dev", *flags]
        started(stack, out / "hall", "second-relay", *command).line("serving")
        replaced = Replacement(ends_s, time.monotonic())
        wait_for(file, lambda counts: counts.count_served(replaced.serves_s) >= viewers)
        crowd.stop()
        counts = HallCounts.read(json.loads(file.read_text()))
    return counts, replaced


def main() -> int:
    asked = options()
    ends_on_term()
    print(f"a hall: {asked.viewers} viewers, {asked.places} places, the relay is replaced once", flush=True)
    counts, replaced = play(asked.viewers, asked.places, asked.out)
    print(make_report(counts, asked.viewers, asked.places, replaced))
    found = find_breaches(counts, asked.viewers, asked.places, replaced)
    result = {"counts": counts.write(), "no_relay_s": replaced.serves_s - replaced.ends_s, "breaches": found}
    (asked.out / "hall.json").write_text(json.dumps(result, indent=1))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
