"""A million viewers of the lane behind 200 cache nodes, as a discrete simulation: what the origin is asked.

`python -m relay.benches.lane.simulation [--viewers 1000000] [--nodes 200]`: viewers who join over a minute,
with delays of their own and clocks that run wrong, ask as the page does (spa/src/stream/lane/lane.ts). Nodes
collapse requests for one name and keep "not yet" for a second. The origin holds a request for 8 s, and 1,000
of them at once. Prints a table as Markdown; `--write` puts it into docs/reference/benchmarks.md.
"""

from __future__ import annotations

import argparse
import heapq
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from tools.bars import PAGE
from tools.pages import fill, table

Seconds = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]

KEY_INTERVAL_S = 4.0
# the page's
AHEAD_S = 0.8
HELD_FROM_S = 0.3  # an answer that took longer was held
FOUND_AFTER = 3
# the origin's and what it says
HOLD_S = 8.0
HELD_MAX = 1000
RETRY_S = 1.0
FIRST_JOIN_S = 12.0  # parts are there by then
FRESH_S = 1.0  # of "not yet" and of the name of a next take, in a cache
ANSWER_S = 0.002
# the network's: median and spread of one way, seconds
WAY_S = (0.030, 0.6)  # log-normal, a viewer's
NODE_WAY_S = (0.005, 0.080)  # uniform, a node's to the origin
CLOCK_RATE = 1e-4  # a viewer's clock is fast or slow by up to so much: waits are measured by it


@dataclass(frozen=True)
class SimulatedPart:
    """A segment: when its frames began and ended, when the origin has it, seconds. `take`: of its run."""

    from_s: float
    to_s: float
    at_s: float
    take: int = 0


@dataclass(frozen=True)
class SimulatedTimeline:
    """What the robot did. `parts` in order; between two takes the origin names the next one."""

    name: str
    parts: tuple[SimulatedPart, ...]


def make_timeline(
    name: str,
    until_s: float = 180.0,
    *,
    begins_s: float = 0.0,
    pause: tuple[float, float] | None = None,
    restart_s: float | None = None,
) -> SimulatedTimeline:
    """Parts of a KEY interval. `pause`: from when, and for how long; `restart_s`: a new run 3 s after it."""
    parts: list[SimulatedPart] = []
    now_s, take = begins_s, 0
    while now_s < until_s:
        end_s, go_on_s, next_take = now_s + KEY_INTERVAL_S, now_s + KEY_INTERVAL_S, take
        if pause is not None and now_s <= pause[0] < end_s:
            end_s, go_on_s = pause[0] + 1.5, pause[0] + pause[1]  # it closes when the word becomes STALE
        elif restart_s is not None and now_s <= restart_s < end_s:
            end_s, go_on_s, next_take = restart_s, restart_s + 3.0, take + 1
        parts.append(SimulatedPart(now_s, end_s, end_s + ANSWER_S, take))
        now_s, take = go_on_s, next_take
    return SimulatedTimeline(name, tuple(parts))


@dataclass
class OriginTally:
    """What the origin was asked, and did."""

    answers: Counter[str] = field(default_factory=Counter)
    held: int = 0
    held_most: int = 0
    turned_away: int = 0  # answered at once, since so many were held
    parts: int = 0  # that nodes have got, each counted for each node
    behind_s: list[Seconds] = field(default_factory=list)

    @property
    def requests_a_part(self) -> float:
        """The origin's answers for each part and node, "not yet" counted where a request was turned away."""
        return (self.answers["segment"] + self.turned_away) / max(1, self.parts)


class SimulatedNode:
    """One cache and its viewers of one robot: each wants a part (a number of the timeline) at a time.

    Collapsing means that a node has one fetch of a name at a time, and that its answer is everybody's who
    asked by then. So of a crowd it matters when the first one asks: the rest is arithmetic on whole arrays.
    """

    def __init__(
        self, line: SimulatedTimeline, viewers: int, join_s: float, draw: np.random.Generator
    ) -> None:
        self.line = line
        self.way_s = float(draw.uniform(*NODE_WAY_S))
        self.viewers_way_s = WAY_S[0] * np.exp(draw.normal(0.0, WAY_S[1], viewers))
        self.rate = 1.0 + draw.uniform(-CLOCK_RATE, CLOCK_RATE, viewers)
        joins_s = FIRST_JOIN_S + draw.uniform(0.0, join_s, viewers)
        there = np.array([part.at_s for part in line.parts])
        # the newest that there was when they asked, two ways later
        self.wanted: Numbers = np.searchsorted(there, joins_s, side="right") - 1
        self.asks_s: Seconds = joins_s + 3 * self.viewers_way_s
        self.close_s: Seconds = np.full(viewers, np.inf)  # the least from a part's end to its arrival
        self.spans_s: Seconds = np.full((3, viewers), np.inf)
        self.seen: Numbers = np.zeros(viewers, np.int64)
        self.got: Numbers = np.zeros(viewers, np.int64)
        self.found = np.zeros(viewers, bool)
        self.said_not_yet = np.zeros(viewers, bool)
        self.first_s = joins_s
        self.here: dict[int, float] = {}  # parts that are in the cache, since when
        self.fresh_s: dict[int, float] = {}  # "not yet" of a part, until when
        self.fetching: dict[int, int] = {}  # parts that are asked for, and by which event
        self.planned_s: dict[int, float] = {}  # when that is; -inf: the origin has been asked
        self.behind: list[Seconds] = []

    def count_summaries(self) -> int:
        """How often the origin is asked where the past ends: once, and whenever that answer is too old."""
        count, until_s = 0, 0.0
        for joins_s in np.sort(self.first_s):
            if joins_s > until_s:
                count, until_s = count + 1, joins_s + FRESH_S
        return count

    def serve(self, number: int) -> None:
        """All who want a part that is here get it when they ask, now or later, and know when to ask next."""
        part, here_s = self.line.parts[number], self.here[number]
        who = np.flatnonzero(self.wanted == number)
        if not who.size:
            return
        way_s = self.viewers_way_s[who]
        got_s = np.maximum(self.asks_s[who], here_s) + way_s
        was_held = (got_s - (self.asks_s[who] - way_s) > HELD_FROM_S + 2 * way_s) | self.said_not_yet[who]
        self.behind.append((got_s - part.from_s)[self.got[who] > 0])
        self.found[who] |= was_held | (self.got[who] >= FOUND_AFTER)
        self.said_not_yet[who] = False
        self.got[who] += 1
        self.close_s[who] = np.minimum(self.close_s[who], got_s - part.to_s)
        self.spans_s[self.got[who] % 3, who] = part.to_s - part.from_s
        due_s = part.to_s + self.close_s[who] + self.spans_s[:, who].min(axis=0) - AHEAD_S
        waits_s = np.where(self.found[who], np.maximum(due_s - got_s, 0.0), 0.0) * self.rate[who]
        self.asks_s[who] = got_s + waits_s + way_s
        self.wanted[who] = number + 1

    def say_not_yet(self, number: int, at_s: float) -> None:
        """Who asked by now, or asks while that is fresh, hears it, and asks again after Retry-Ms."""
        self.fresh_s[number] = until_s = at_s + FRESH_S
        who = np.flatnonzero((self.wanted == number) & (self.asks_s <= until_s))
        way_s = self.viewers_way_s[who]
        self.asks_s[who] = np.maximum(self.asks_s[who], at_s) + 2 * way_s + RETRY_S * self.rate[who]
        self.said_not_yet[who] = True

    def list_wanted(self) -> dict[int, float]:
        """Which parts are wanted, and when each is asked for next."""
        found: dict[int, float] = {}
        for number in map(int, np.unique(self.wanted)):
            if number < len(self.line.parts):
                found[number] = float(self.asks_s[self.wanted == number].min())
        return found


class SimulatedOrigin:
    """All nodes before one origin, and what happens in order of time."""

    def __init__(self, nodes: Sequence[SimulatedNode], held_max: int) -> None:
        self.tally = OriginTally()
        self._nodes = nodes
        self._held_max = held_max
        self._ends_s = max(node.line.parts[-1].to_s for node in nodes)
        self._order = 0
        self._events: list[tuple[float, int, str, int, int]] = []

    def run(self) -> OriginTally:
        """Until the last part."""
        for node in range(len(self._nodes)):
            self._look(node)
        while self._events:
            at_s, order, what, node, number = heapq.heappop(self._events)
            if what == "ask":
                if self._nodes[node].fetching.get(number) == order:  # nobody has come before
                    self._take_request(at_s, node, number)
            elif what == "release":
                self.tally.held -= 1
                self._answer(at_s, node, number)
            else:
                self._take_answer(at_s, what, node, number)
        self.tally.behind_s = [ages for node in self._nodes for ages in node.behind]
        self.tally.parts = sum(len(node.here) for node in self._nodes)
        self.tally.answers["past"] = sum(node.count_summaries() for node in self._nodes)
        return self.tally

    def _plan(self, at_s: float, what: str, node: int, number: int) -> int:
        self._order += 1
        if at_s < self._ends_s:
            heapq.heappush(self._events, (at_s, self._order, what, node, number))
        return self._order

    def _look(self, node: int) -> None:
        """What is here is handed out; of what is not, the next fetch is planned."""
        mine = self._nodes[node]
        while here := [n for n in mine.list_wanted() if n in mine.here]:
            for number in here:
                mine.serve(number)
        for number, at_s in mine.list_wanted().items():
            planned_s = mine.planned_s.get(number, float("inf"))
            if at_s < planned_s:
                mine.planned_s[number] = at_s
                mine.fetching[number] = self._plan(at_s + mine.way_s, "ask", node, number)

    def _take_request(self, at_s: float, node: int, number: int) -> None:
        there_s = self._nodes[node].line.parts[number].at_s
        self._nodes[node].planned_s[number] = float("-inf")  # whoever asks from now on waits with it
        if there_s <= at_s:
            self._answer(at_s, node, number)
        elif self.tally.held >= self._held_max:
            self.tally.turned_away += 1
            self._answer(at_s, node, number)
        else:
            self.tally.held += 1
            self.tally.held_most = max(self.tally.held_most, self.tally.held)
            self._plan(min(there_s, at_s + HOLD_S), "release", node, number)

    def _answer(self, at_s: float, node: int, number: int) -> None:
        parts = self._nodes[node].line.parts
        is_there = parts[number].at_s <= at_s
        self.tally.answers["segment" if is_there else "not yet"] += 1
        # its name in the old take was answered with that in the new one
        self.tally.answers["next"] += is_there and number > 0 and parts[number].take != parts[number - 1].take
        what = "part" if is_there else "not yet"
        self._plan(at_s + ANSWER_S + self._nodes[node].way_s, what, node, number)

    def _take_answer(self, at_s: float, what: str, node: int, number: int) -> None:
        mine = self._nodes[node]
        del mine.fetching[number], mine.planned_s[number]
        if what == "part":
            mine.here[number] = at_s
        else:
            mine.say_not_yet(number, at_s)
        self._look(node)


def simulate(
    robots: Sequence[SimulatedTimeline],
    nodes: int,
    viewers: int,
    *,
    join_s: float = 60.0,
    held_max: int = HELD_MAX,
    seed: int = 1,
) -> OriginTally:
    """`viewers` of all robots together, spread evenly: each node has its share of each robot's."""
    draw, each = np.random.default_rng(seed), viewers // (nodes * len(robots))
    every = [SimulatedNode(line, each, join_s, draw) for line in robots for _ in range(nodes)]
    return SimulatedOrigin(every, held_max).run()


PAUSE = (80.0, 60.0)
BOTH_PAUSE = (make_timeline("a", pause=PAUSE), make_timeline("b", pause=PAUSE))
SIX_PAUSE = tuple(make_timeline(name, pause=PAUSE) for name in "abcdef")
CASES: tuple[tuple[str, int, tuple[SimulatedTimeline, ...]], ...] = (  # with what the origin holds at once
    ("one robot", HELD_MAX, (make_timeline("a"),)),
    ("one robot, pauses for 60 s", HELD_MAX, (make_timeline("a", pause=PAUSE),)),
    ("one robot, ends and returns as another run", HELD_MAX, (make_timeline("a", restart_s=90.5),)),
    ("two robots, their KEYs 2 s apart", HELD_MAX, (make_timeline("a"), make_timeline("b", begins_s=2.0))),
    ("two robots, their KEYs at the same time", HELD_MAX, (make_timeline("a"), make_timeline("b"))),
    ("two robots, both pause for 60 s", HELD_MAX, BOTH_PAUSE),
    ("the same, but the origin holds 300", 300, BOTH_PAUSE),
    ("six robots, all pause for 60 s", HELD_MAX, SIX_PAUSE),
)
HEAD: tuple[str, ...] = (
    "case",
    "segments × nodes",
    "origin answers with a segment",
    "(these + turned away) ÷ (segments × nodes)",
    "“not yet”",
)
HEAD += ("“take is over”", "most held at once", "turned away", "delay p50", "p95")


def make_row(name: str, tally: OriginTally) -> list[str]:
    """One line of the table."""
    behind_s, said = np.concatenate(tally.behind_s), tally.answers
    return [
        name,
        f"{tally.parts:,}",
        f"{said['segment']:,}",
        f"**{tally.requests_a_part:.3f}**",
        f"{said['not yet']:,}",
        f"{said['next']:,}",
        f"{tally.held_most}",
        f"{tally.turned_away:,}",
        *(f"{float(np.percentile(behind_s, share)):.2f} s" for share in (50, 95)),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--viewers", type=int, default=1_000_000)
    parser.add_argument("--nodes", type=int, default=200)
    parser.add_argument("--write", action="store_true", help="into docs/reference/benchmarks.md")
    asked = parser.parse_args()
    began, rows = time.monotonic(), []
    for number, (name, held_max, robots) in enumerate(CASES, 1):
        print(f"{number}/{len(CASES)}: {name}", file=sys.stderr, flush=True)
        rows.append(make_row(name, simulate(robots, asked.nodes, asked.viewers, held_max=held_max)))
    made = table(HEAD, rows)
    print(f"{made}\n\n{time.monotonic() - began:.0f} s")
    if asked.write:
        PAGE.write_text(fill(PAGE.read_text(), {"lane-simulation": made}, PAGE.name))
    return 0


if __name__ == "__main__":
    sys.exit(main())
