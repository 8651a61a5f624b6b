"""The effect of one attack on the innocent, and whether it is within the promised limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

SHARE_MIN = 0.95  # of the innocent robot's frames that its viewer gets
GAP_MAX_S = 0.3
GROWTH_MAX_MB = 60.0  # of the relay, 10⁶ bytes
LINES_MAX_PER_S = 10.0
NEWCOMER_MAX_S = 2.0
ON_ITS_WAY_S = 0.3
WAITED_S = 0.3  # worth saying: others compute on this machine


@dataclass(frozen=True)
class Row:
    """Beside one attack. `gap_s`: the longest time without a frame; `newcomer_s`: from the moment that a
    robot and a viewer of it come, in the middle of the attack, to the first frame. `words`: the viewer's
    other state words. `held_up_s`: how long the machine prevented the innocent robot from sending;
    `waited_s`: how long the relay wanted to compute but got no core.
    """

    name: str
    what: str
    did: str
    share: float
    gap_s: float
    newcomer_s: float
    growth_mb: float
    lines_per_s: float
    tracebacks: int
    words: tuple[str, ...] = ()
    held_up_s: float = 0.0
    waited_s: float = 0.0
    ended: bool = False  # the relay itself
    failed: str = ""  # why there was no attack
    again: bool = False  # played once more after a miss


def shares(
    sent: Sequence[tuple[int, float]], came: Sequence[tuple[int, float]], from_s: float, to_s: float
) -> float:
    """The share of the frames sent in that time that arrived in time: (seq, monotonic s) at either end."""
    due = {seq for seq, at in sent if from_s <= at <= to_s - ON_ITS_WAY_S}
    got = {seq for seq, at in came if at <= to_s}
    return len(due & got) / len(due) if due else 0.0


def longest_gap_s(came: Sequence[float], from_s: float, to_s: float) -> float:
    """The longest time without any, ends included."""
    times = [from_s, *(at for at in came if from_s < at < to_s), to_s]
    return max(b - a for a, b in pairwise(times))


def held_up_s(sent: Sequence[float], period_s: float, from_s: float, to_s: float) -> float:
    """The worst delay in sending a frame, whatever held up the sender."""
    return max(0.0, longest_gap_s(sent, from_s, to_s) - 1.5 * period_s)


def misses(row: Row, control: Row | None) -> list[str]:
    """The broken promises, one line each. `control`: the same without an attack.

    A machine that stutters makes frames late for everybody: that part is not blamed on the attack.
    """
    gap_max_s = max(GAP_MAX_S, control.gap_s if control else 0.0) + row.held_up_s
    share_min = SHARE_MIN * (min(1.0, control.share) if control else 1.0)
    found = []
    if row.failed:
        found.append(f"the attacker failed: {row.failed}")
    if row.ended:
        found.append("the relay ended")
    if row.share < share_min:
        found.append(f"{row.share:.0%} of the frames, {share_min:.0%} wanted")
    if row.gap_s > gap_max_s:
        found.append(f"{row.gap_s:.2f} s without a frame, {gap_max_s:.2f} allowed")
    if row.newcomer_s > NEWCOMER_MAX_S:
        found.append(f"{row.newcomer_s:.2f} s to a newcomer's first frame, {NEWCOMER_MAX_S:g} allowed")
    if row.growth_mb > GROWTH_MAX_MB:
        found.append(f"the relay grew by {row.growth_mb:.0f} MB, {GROWTH_MAX_MB:g} allowed")
    if row.lines_per_s > LINES_MAX_PER_S:
        found.append(f"{row.lines_per_s:.0f} lines a second in the log, {LINES_MAX_PER_S:g} allowed")
    if row.tracebacks:
        found.append(f"{row.tracebacks} tracebacks in the log")
    if row.words:
        found.append(f"its viewer read {', '.join(row.words)}")
    busy = f" (it waited {row.waited_s:.1f} s for a core)" if row.waited_s > WAITED_S else ""
    return [f"{row.name}: {miss}{busy}" for miss in found]


HEAD = ("attack", "rate", "frames", "gap s", "newcomer s", "relay + MB", "log lines/s")


def cells(row: Row) -> tuple[str, ...]:
    """The cells of the table except the first."""
    numbers = (f"{row.share:.1%}", f"{row.gap_s:.2f}", f"{row.newcomer_s:.2f}", f"{row.growth_mb:.0f}")
    return (row.did, *numbers, f"{row.lines_per_s:.1f}")
