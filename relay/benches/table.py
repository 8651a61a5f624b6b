"""Rows to text: per scenario a table with medians and spreads, then what must be reached."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import median

from relay.benches.measure import Row
from relay.benches.scenarios import SCENARIOS, Scenario

GENERATOR_LIMIT = 0.8
NEVER_S = 999.0  # stands for "not within the run"


def of(rows: Iterable[Row], scenario: str, server: str) -> list[Row]:
    return [row for row in rows if row["scenario"] == scenario and row["server"] == server]


def spread(values: Sequence[float], digits: int = 0) -> str:
    """median (min–max)"""
    if not values:
        return "—"
    if len(values) == 1:
        return f"{values[0]:,.{digits}f}"
    return f"{median(values):,.{digits}f} ({min(values):,.{digits}f}–{max(values):,.{digits}f})"


def ratios(
    rows: Sequence[Row], above: tuple[str, str], below: tuple[str, str], figure: Callable[[Row], float]
) -> list[float]:
    """figure(above) ÷ figure(below), each pair from one round; `above`, `below`: scenario and server."""
    found = []
    for row in of(rows, *above):
        same = [r for r in of(rows, *below) if r["round"] == row["round"]]
        if same and figure(same[0]) > 0:
            found.append(figure(row) / figure(same[0]))
    return found


def print_table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> None:
    widths = [max(len(line[i]) for line in (head, *lines)) for i in range(len(head))]
    for line in (head, *lines):
        print("  " + "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip())


def flags(mine: Sequence[Row]) -> str:
    said = []
    if any(row["generator_share"] >= GENERATOR_LIMIT for row in mine):
        said.append("generator too busy")
    if any(row["failed"] or row["closed"] for row in mine):
        refused, lost = sum(r["failed"] for r in mine), sum(r["closed"] for r in mine)
        said.append(f"{refused} refused, {lost} lost {mine[-1]['closings']}")
    if any(row["orphans"] or row["unreadable"] for row in mine):
        said.append("frames that can't be decoded")
    return "; ".join(said)


def steady_line(rows: Sequence[Row], scenario: Scenario, server: str) -> list[str]:
    mine = of(rows, scenario.name, server)
    cost = ratios(rows, (scenario.name, server), (scenario.name, "bare"), lambda r: float(r["cpu_us"]))
    return [
        server,
        spread([r["messages_per_cpu_s"] for r in mine]),
        spread([r["cpu_us"] for r in mine], 1),
        spread(cost, 2),
        f"{median(r['delivered'] for r in mine):.0%}",
        spread([r["lateness_ms"]["p50"] for r in mine], 1),
        spread([r["lateness_ms"]["p99"] for r in mine], 1),
        f"{median(r['rss_mb_per_1000'] for r in mine):.1f}",
        f"{median(r['message_bytes'] for r in mine):.0f}",
        f"{median(r['server_share'] for r in mine):.0%}/{max(r['others_share'] for r in mine):.0%}",
        f"{max(r['generator_share'] for r in mine):.0%}",
        flags(mine),
    ]


def storm_line(rows: Sequence[Row], scenario: Scenario, server: str) -> list[str]:
    mine = of(rows, scenario.name, server)
    return [
        server,
        spread([r["handshakes_per_s"] for r in mine]),
        spread([r["handshake_ms"]["p99"] for r in mine]),
        spread([r["lag_ms"]["max"] for r in mine if r.get("lag_ms")]),
        f"{median(r['rss_mb_per_1000'] for r in mine):.1f}",
        f"{max(r['generator_share'] for r in mine):.0%}",
        flags(mine),
    ]


STEADY = ["server", "msgs/CPU-s", "µs CPU/msg", "÷ bare", "delivered", "p50 ms", "p99 ms"]
STEADY += ["RSS MB/1k", "bytes", "core/others", "generator", ""]
STORM = ["server", "handshakes/s", "p99 ms", "longest pause ms", "RSS MB/1k", "generator", ""]


def print_scenario(rows: Sequence[Row], scenario: Scenario) -> None:
    servers = [s for s in scenario.servers if of(rows, scenario.name, s)]
    if not servers:
        return
    runs = len(of(rows, scenario.name, servers[0]))
    print(f"\n{scenario.title} · {runs} run(s), median (min–max)")
    line = storm_line if scenario.storm else steady_line
    print_table(STORM if scenario.storm else STEADY, [line(rows, scenario, server) for server in servers])


@dataclass(frozen=True)
class Goal:
    name: str
    limit: float
    values: list[float]
    at_least: bool = False
    digits: int = 2

    @property
    def reached(self) -> bool:
        middle = median(self.values)
        return middle >= self.limit if self.at_least else middle <= self.limit


def cpu_us(row: Row) -> float:
    return float(row["cpu_us"])


def p99_ms(row: Row) -> float:
    return float(row["lateness_ms"]["p99"])


def handshakes_per_s(row: Row) -> float:
    return float(row["handshakes_per_s"])


def lags_ms(rows: Sequence[Row], which: str) -> list[float]:
    return [row["lag_ms"][which] for row in rows if row.get("lag_ms")]


def goals(rows: Sequence[Row]) -> list[Goal]:
    """What the issue "The relay that holds a lecture hall" asks for, as far as it was measured."""
    relay = ("steady-1000", "relay")
    steady, storm = of(rows, *relay), of(rows, "storm", "relay")
    watched = [r for s in ("steady-1000", "steady-2000", "ten-hz", "healthy") for r in of(rows, s, "relay")]
    frozen, resumed = of(rows, "frozen", "relay"), of(rows, "resumed", "relay")
    to_bare = ratios(rows, relay, ("steady-1000", "bare"), cpu_us)
    to_fastapi = ratios(rows, ("steady-1000", "fastapi"), relay, cpu_us)
    to_broadcast = ratios(rows, ("steady-1000", "websockets"), relay, cpu_us)
    handshakes = ratios(rows, ("storm", "relay"), ("storm", "fastapi"), handshakes_per_s)
    disturbed = ratios(rows, ("frozen", "relay"), ("healthy", "relay"), p99_ms)
    beside = ratios(rows, ("looking-back", "relay"), ("healthy", "relay"), p99_ms)
    looked = of(rows, "looking-back", "relay")
    gone_s = [r["frozen"]["fds_gone_s"] or NEVER_S for r in frozen]
    never_seen = [float(r["frozen"]["count"] - r["frozen"]["gone"]) for r in frozen]  # the kernel holds on
    found = [
        Goal("CPU per message ÷ bare send(), 1,000 × 30 Hz", 1.25, to_bare),
        Goal("FastAPI loop ÷ relay", 2, to_fastapi, at_least=True),
        Goal("websockets.broadcast() ÷ relay", 1.5, to_broadcast, at_least=True),
        Goal("RSS per 1,000 viewers, MB", 16, [r["rss_mb_per_1000"] for r in steady], digits=1),
        Goal("duplicates + reordered", 0, [r["duplicates"] + r["reordered"] for r in watched], digits=0),
        Goal("skipped, %", 0.1, [r["missed_share"] * 100 for r in watched], digits=3),
        Goal("Jain fairness", 0.99, [r["jain"] for r in watched], at_least=True, digits=4),
        Goal("handshakes/s ÷ FastAPI's", 1.5, handshakes, at_least=True),
        Goal("longest pause in the storm, ms", 150, lags_ms(storm, "max"), digits=0),
        Goal("loop lateness p99, 3,000 × 10 Hz, ms", 40, lags_ms(of(rows, "loop", "relay"), "p99"), digits=1),
        Goal("5 % frozen: the others' p99 ÷ baseline", 1.25, disturbed),
        Goal("200 look back: p99 of the live ÷ baseline", 1.25, beside),
        Goal("200 look back: skipped by the live", 0, [float(r["missed"]) for r in looked], digits=0),
        Goal("5 % frozen: RSS each, KiB", 128, [r["frozen"]["rss_kib_each"] for r in frozen], digits=0),
        Goal("5 % frozen: descriptors gone after, s", 20, gone_s, digits=1),
        Goal("5 % frozen: connections never seen to end", 0, never_seen, digits=0),
        Goal("resumed: frames of the freeze handed over, s", 2, [r["frozen"]["backlog_s"] for r in resumed]),
    ]
    return [goal for goal in found if goal.values]


def print_goals(rows: Sequence[Row]) -> None:
    lines = [
        [
            goal.name,
            f"{'≥' if goal.at_least else '≤'} {goal.limit:g}",
            spread(goal.values, goal.digits),
            "reached" if goal.reached else "MISSED",
        ]
        for goal in goals(rows)
    ]
    if lines:
        print("\nMust reach (ratios within one round)")
        print_table(["", "goal", "median (min–max)", ""], lines)


def print_all(rows: Sequence[Row]) -> None:
    for scenario in SCENARIOS:
        print_scenario(rows, scenario)
    print_goals(rows)
