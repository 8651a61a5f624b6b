"""Counts that add up across viewers and worker processes, and the verdict on them."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields

# lateness buckets: upper edges in ms, about 12 % apart, so a percentile is off by at most that
_EDGES_MS = tuple(round(1.12**power, 3) for power in range(100))


@dataclass
class Tally:
    """One process's counts. All members add; `counts` and `sum` carry them between processes."""

    viewers: int = 0
    refused: int = 0
    closed: int = 0
    frames: int = 0
    missed: int = 0
    duplicates: int = 0
    reordered: int = 0
    undecodable: int = 0
    lowered: int = 0  # times the relay told a viewer that it gets fewer frames
    evicted: int = 0  # viewers that no longer read, cut by the relay as they should be
    unevicted: int = 0  # … and still not cut when they read again
    slow_frames: int = 0  # to viewers that read slowly; in no other count of frames
    slow_viewers: int = 0
    slow_starved: int = 0  # slow viewers that got no frame in a whole connection
    workers_lost: int = 0  # processes whose end is not known: their viewers count up to their last report
    rate_sum_hz: float = 0.0
    rate_square_sum: float = 0.0
    buckets: list[int] = field(default_factory=lambda: [0] * (len(_EDGES_MS) + 1))

    def frame(self, lateness_s: float) -> None:
        """One frame that arrived this late."""
        self.frames += 1
        self.buckets[bisect_left(_EDGES_MS, lateness_s * 1000)] += 1

    def viewer(self, rate_hz: float) -> None:
        """One viewer's end, having got `rate_hz` frames a second on average."""
        self.viewers += 1
        self.rate_sum_hz += rate_hz
        self.rate_square_sum += rate_hz * rate_hz

    def clear(self) -> None:
        """Begin anew."""
        self.__dict__.update(Tally().__dict__)

    def percentile_ms(self, share: float) -> float:
        """The lateness that `share` of the frames keep, ms; infinite beyond the last bucket."""
        rest = share * self.frames
        for edge, count in zip((*_EDGES_MS, float("inf")), self.buckets, strict=True):
            rest -= count
            if rest <= 0:
                return edge if self.frames else 0.0
        return float("inf")

    @property
    def jain(self) -> float:
        """Jain's fairness index of the viewers' rates, (Σx)² / (n Σx²): 1 when all got the same."""
        if self.rate_square_sum == 0:
            return 0.0
        return self.rate_sum_hz**2 / (self.viewers * self.rate_square_sum)

    def counts(self) -> dict[str, float | list[int]]:
        """As plain JSON."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @classmethod
    def sum(cls, parts: Iterable[Mapping[str, float | list[int]]]) -> Tally:
        """Several processes' `counts` as one tally."""
        total = cls()
        for part in parts:
            for name, value in part.items():
                mine = getattr(total, name)
                if isinstance(value, list):
                    setattr(total, name, [a + b for a, b in zip(mine, value, strict=True)])
                else:
                    setattr(total, name, mine + value)
        return total


@dataclass(frozen=True)
class LoadLimits:
    """What a load test must keep. `p99_ms` is held against the control viewer where there is one."""

    missed_share: float = 0.001
    p99_ms: float = 200.0
    jain: float = 0.99


def breaches(tally: Tally, limits: LoadLimits, control: Tally | None = None) -> list[str]:
    """One line for every limit that did not hold. `control`: what a viewer in a process of its own saw."""
    found: list[str] = []
    if tally.frames == 0:
        found.append("no viewer got a frame")
    for name in (
        "refused",
        "closed",
        "duplicates",
        "reordered",
        "undecodable",
        "lowered",
        "unevicted",
        "slow_starved",
        "workers_lost",
    ):
        count = getattr(tally, name)
        if count:
            found.append(f"{count} {name.replace('_', ' ')}")
    share = tally.missed / max(1, tally.frames + tally.missed)
    if share > limits.missed_share:
        found.append(f"missed {share:.2%} of the frames, over {limits.missed_share:.2%}")
    if control is not None and control.frames == 0:
        found.append("the control viewer got no frame")
    p99_ms = (control or tally).percentile_ms(0.99)
    if p99_ms > limits.p99_ms:
        found.append(f"p99 lateness {p99_ms:.0f} ms, over {limits.p99_ms:.0f} ms")
    if tally.viewers and tally.jain < limits.jain:
        found.append(f"fairness {tally.jain:.4f}, under {limits.jain:.2f}")
    return found


def report(tally: Tally, limits: LoadLimits, control: Tally | None = None) -> str:
    """The test's last words, for a person."""

    def late(of: Tally) -> str:
        return f"p50 {of.percentile_ms(0.5):.0f} ms, p99 {of.percentile_ms(0.99):.0f} ms"

    lines = [
        f"viewers      {tally.viewers} healthy ones (refused {tally.refused}, closed early {tally.closed})",
        f"frames       {tally.frames} in all; Locust's table has every tenth of each viewer's",
        f"missed       {tally.missed}",
        f"duplicates   {tally.duplicates}, out of order {tally.reordered}",
        f"undecodable  {tally.undecodable}",
        f"lateness     {late(tally)}, in the load generator",
    ]
    if control is not None:
        lines.append(f"control      {late(control)}, {control.missed} missed, in a process of its own")
    lines.append(f"fairness     {tally.jain:.4f} (Jain)")
    if tally.slow_viewers:
        lines.append(f"slow         {tally.slow_viewers} viewers got {tally.slow_frames} frames")
    if tally.evicted or tally.unevicted:
        lines.append(f"frozen       {tally.evicted} cut by the relay, {tally.unevicted} not")
    found = breaches(tally, limits, control)
    lines += [f"BREACH       {line}" for line in found] or ["all limits kept"]
    return "\n".join(lines)
