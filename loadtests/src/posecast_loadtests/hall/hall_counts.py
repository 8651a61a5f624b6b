"""The counts of a hall's viewers as one JSON document, and the verdict on them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

REFUSALS_KEPT = 1000


@dataclass
class HallViewer:
    """One viewer. Times are monotonic s; 0: nothing yet."""

    by: str = ""  # socket, or lane
    last_s: float = 0.0  # when something new last arrived
    longest_s: float = 0.0  # the longest time between two such moments
    longest_from_s: float = 0.0

    def show(self, by: str, now_s: float) -> None:
        """Note that something new has arrived."""
        if self.last_s and now_s - self.last_s > self.longest_s:
            self.longest_s, self.longest_from_s = now_s - self.last_s, self.last_s
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
