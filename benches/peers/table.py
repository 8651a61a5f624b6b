"""Rows to text: what a message costs beside the relay's, and what becomes of who doesn't read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from statistics import median

from benches.peers.peers import RELAY
from relay.benches.measure import Row
from relay.benches.scenarios import Scenario
from relay.benches.table import cpu_us, flags, of, print_table, ratios, spread

STEADY = ["server", "messages per CPU-s", "µs CPU each", "÷ relay", "MB per viewer-hour", "RSS MB per 1,000"]
STEADY += ["p50 ms", "p99 ms", "delivered", "core/others", ""]
SLOW = ["server", "the others missed", "their p99 ms", "memory per slow viewer", "cut after"]


def steady_line(rows: Sequence[Row], scenario: Scenario, server: str) -> list[str]:
    mine = of(rows, scenario.name, server)
    to_relay = ratios(rows, (scenario.name, server), (scenario.name, RELAY), cpu_us)
    return [
        server,
        spread([r["messages_per_cpu_s"] for r in mine]),
        spread([r["cpu_us"] for r in mine], 1),
        spread(to_relay, 2),
        f"{median(r['mb_per_viewer_hour'] for r in mine):.1f}",
        f"{median(r['rss_mb_per_1000'] for r in mine):.1f}",
        spread([r["lateness_ms"]["p50"] for r in mine], 1),
        spread([r["lateness_ms"]["p99"] for r in mine], 1),
        f"{median(r['delivered'] for r in mine):.0%}",
        f"{median(r['server_share'] for r in mine):.0%}/{max(r['others_share'] for r in mine):.0%}",
        flags(mine),
    ]


def cut_after(row: Row) -> str:
    """When the server had closed the last connection of those who don't read."""
    after_s = row["frozen"]["fds_gone_s"]
    return f"not in {row['wall_s']:.0f} s" if after_s is None else f"{after_s:.0f} s"


def slow_line(rows: Sequence[Row], scenario: Scenario, server: str) -> list[str]:
    mine = of(rows, scenario.name, server)
    return [
        server,
        f"{median(r['missed_share'] for r in mine):.1%}",
        spread([r["lateness_ms"]["p99"] for r in mine], 1),
        f"{median(r['frozen']['rss_kib_each'] for r in mine):,.0f} KiB",
        cut_after(mine[-1]),
    ]


def print_all(rows: Sequence[Row], scenarios: Sequence[Scenario]) -> None:
    """A table for each scenario that has rows."""
    line: Callable[[Sequence[Row], Scenario, str], list[str]]
    for scenario in scenarios:
        servers = list(dict.fromkeys(row["server"] for row in rows if row["scenario"] == scenario.name))
        if not servers:
            continue
        head, line = (SLOW, slow_line) if scenario.frozen else (STEADY, steady_line)
        print(f"\n{scenario.title}")
        print_table(head, [line(rows, scenario, server) for server in servers])
