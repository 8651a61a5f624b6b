"""`python -m benches.peers.page`: puts the last run's tables (out/peers/peers.json) into
docs/reference/benchmarks.md.

Between their two markers; the plots are drawn anew from them (tools/bars.py).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

from benches.peers.peers import OUT, PEERS, RELAY
from benches.peers.run import SCENARIOS
from benches.peers.table import cut_after
from relay.benches.bench import DISTURBED
from relay.benches.measure import Row
from relay.benches.scenarios import Scenario
from relay.benches.table import cpu_us, of, ratios, spread
from tools import bars
from tools.pages import fill, table

STEADY = ["server", "÷ relay", "µs CPU per message", "messages per CPU-second", "p50 ms", "p99 ms"]
STEADY += ["MB per viewer and hour", "MB RSS per 1,000 viewers", "others' share"]
SLOW = ["server", "KiB per stopped viewer", "cut after", "missed by the others", "p99 of the others, ms", ""]
TABLES = {  # its columns, and its plot as tools/bars.py is told: title, column, unit
    "steady": (STEADY, "bench-peers", "CPU per message, compared with the relay | ÷ relay | ×"),
    "slow": (SLOW, "bench-peers-slow", f"Memory for a viewer that stops reading | {SLOW[1]} | KiB"),
}
NOTES = {
    "foxglove": "bounded at 1,024 messages; drops the oldest",
    "nats": "bounded at 64 MB, by its documentation",
    "mosquitto": "the queues of all viewers fill",
}


def steady_line(rows: Sequence[Row], scenario: Scenario, server: str) -> list[str]:
    """What a message costs, on its way and in memory."""
    mine = of(rows, scenario.name, server)
    return [
        spread(ratios(rows, (scenario.name, server), (scenario.name, RELAY), cpu_us), 2),
        spread([r["cpu_us"] for r in mine], 1),
        spread([r["messages_per_cpu_s"] for r in mine]),
        spread([r["lateness_ms"]["p50"] for r in mine], 1),
        spread([r["lateness_ms"]["p99"] for r in mine], 1),
        f"{median(r['mb_per_viewer_hour'] for r in mine):.1f}",
        f"{median(r['rss_mb_per_1000'] for r in mine):.1f}",
        f"{max(r['others_share'] for r in mine):.0%}",
    ]


def slow_line(rows: Sequence[Row], scenario: Scenario, server: str) -> list[str]:
    """What becomes of who doesn't read, and of the others."""
    mine = of(rows, scenario.name, server)
    return [
        spread([r["frozen"]["rss_kib_each"] for r in mine]),
        cut_after(mine[-1]),
        f"{median(r['missed_share'] for r in mine):.1%}",
        spread([r["lateness_ms"]["p99"] for r in mine], 1),
        NOTES.get(server, ""),
    ]


def make_table(head: Sequence[str], rows: Sequence[Row], scenario: Scenario) -> str:
    """Markdown, the relay first and bold, then the cheapest first."""
    line = slow_line if scenario.frozen else steady_line
    titles = {peer.name: peer.title.partition(":")[0].partition(",")[0] for peer in PEERS}
    servers = list(dict.fromkeys(row["server"] for row in rows if row["scenario"] == scenario.name))
    if not scenario.frozen:
        servers.sort(key=lambda name: median(cpu_us(row) for row in of(rows, scenario.name, name)))
    servers.sort(key=lambda name: name != RELAY)
    lines = []
    for name in servers:
        first, *rest = line(rows, scenario, name)
        cells = [titles[name], first, *rest]
        lines.append([f"**{titles[name]}**", f"**{first}**", *rest] if name == RELAY else cells)
    return table(head, lines)


def block(report: dict[str, Any]) -> str:
    """What stands between the markers."""
    rows: list[Row] = report["runs"]
    about = report["machine"]
    worst = max(row["others_share"] for row in rows)
    rounds = 1 + max(row["round"] for row in rows)
    disturbed = (
        "" if worst < DISTURBED else " **Disturbed**: other processes took more than a tenth; see the column."
    )
    said = [
        f"{about['day']}, commit `{about['commit']}`, Linux {about['kernel']}, {about['cores']} cores"
        f" ({about['cpu']}), {rounds} round{'s' if rounds > 1 else ''}; load average"
        f" {about['load_average_before']:.1f} before, {about['load_average_after']:.1f} after; other"
        f" processes took at most {worst:.0%} of the server's core.{disturbed}",
    ]
    for name, (head, image, bar) in TABLES.items():
        scenario = SCENARIOS[name]
        if any(row["scenario"] == name for row in rows):
            said += ["", f"{scenario.title}:", "", f"<!-- bars: ../img/{image}.svg | {bar} -->", ""]
            said.append(make_table(head, rows, scenario))
            said += ["", f"![{bar.partition(' |')[0]}](../img/{image}.svg)"]
    if report["absent"]:
        missing = "; ".join(f"{name} ({why})" for name, why in report["absent"].items())
        said += ["", f"Not measured: {missing}."]
    return "\n".join(said)


def main() -> int:
    parser = argparse.ArgumentParser(prog="page", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("report", type=Path, nargs="?", default=OUT / "peers.json")
    report: Path = parser.parse_args().report
    try:
        made = {"peers": block(json.loads(report.read_text()))}
        page = fill(bars.PAGE.read_text(), made, bars.PAGE.name)
    except FileNotFoundError:
        print(f"page: no {report}: `make peers` writes it", file=sys.stderr)
        return 2
    bars.PAGE.write_text(page)
    bars.draw()
    return 0


if __name__ == "__main__":
    sys.exit(main())
