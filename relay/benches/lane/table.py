"""Rows of the lane's bench as Markdown, and what must be reached."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from statistics import median

from relay.benches.lane.measure import HELD_S, LanePlan
from relay.benches.lane.robot import KEY_INTERVAL_S
from relay.benches.lane.stage import Row
from relay.benches.table import Goal, spread
from tools.pages import table

REQUESTS_GOAL, CPU_GOAL, BYTES_GOAL = 1.02, 1.25, 0.65
BEHIND_S = 0.7  # more than a KEY interval
PAUSE_S = LanePlan.pause_s  # of rows that do not say it


def pick(rows: Iterable[Row], **said: object) -> list[Row]:
    """Those of which all of this is true."""
    return [row for row in rows if all(row.get(name) == value for name, value in said.items())]


def list_crowds(rows: Iterable[Row]) -> list[int]:
    return sorted({row["viewers"] for row in rows if row["scenario"] != "bytes"})


def list_caches(rows: Iterable[Row]) -> list[str]:
    return list(dict.fromkeys(row["cache"] for row in rows if row["cache"] != "WebSocket"))


def count_segments(row: Row) -> float:
    """How many segments there were for a node: those that it got, but in a steady window its KEY intervals.

    So a node that asks for old ones as well is found out.
    """
    steady = row["scenario"] == "steady"
    return float(round(row["wall_s"] / KEY_INTERVAL_S) if steady else row["origin"]["segments"])


def requests_a_segment(row: Row) -> float:
    """Of the origin and one node. In a pause there is "not yet", one while a request is held: not counted.

    Where a take is over a node is told so once: not counted either.
    """
    origin = row["origin"]
    asked = origin["segment"] + origin["other"] + (origin["not-yet"] if row["scenario"] == "steady" else 0)
    return float(asked / max(1.0, count_segments(row)))


def request_ms(row: Row) -> float:
    """CPU of the origin's handlers for what one node asked, a segment."""
    return float(row["origin"]["cpu_ms"] / max(1, row["origin"]["segments"]))


def trouble(row: Row) -> float:
    """What may not happen to a viewer: refused, cut off, a frame twice or missing, nothing at all."""
    counts = (row[name] for name in ("gaps", "repeats", "lost", "silent", "unreadable"))
    return float(sum(counts) + sum(row["refused"].values()) + (row["least"] == 0))


STEADY = ["viewers per cache", "cache", "origin requests per segment and cache"]
STEADY += [
    "origin CPU per request",
    "total origin CPU",
    "the cache's share of a core",
    "delay p50",
    "delay p95",
    "max",
]


def make_steady(rows: Sequence[Row]) -> str:
    lines = []
    for viewers in list_crowds(rows):
        for cache in list_caches(rows):
            mine = pick(rows, scenario="steady", viewers=viewers, cache=cache)
            if not mine:
                continue
            lines.append(
                [
                    f"{viewers:,}",
                    cache,
                    spread([requests_a_segment(row) for row in mine], 2),
                    f"{spread([request_ms(row) for row in mine], 2)} ms",
                    f"{spread([row['cpu_ms'] for row in mine])} ms",
                    f"{median(row['cache_share'] for row in mine):.0%}",
                    f"{median(row['age_ms']['p50'] for row in mine) / 1e3:.2f} s",
                    f"{median(row['age_ms']['p95'] for row in mine) / 1e3:.2f} s",
                    f"{max(row['age_ms']['max'] for row in mine) / 1e3:.2f} s",
                ]
            )
    return table(STEADY, lines)


TROUBLE = ["viewers per cache", "cache", "event", "new segments", "origin requests for them"]
TROUBLE += ["“not yet”", "“take is over”", "refused, lost, duplicated, gaps", "fewest segments of a viewer"]


def make_trouble(rows: Sequence[Row]) -> str:
    lines = []
    for scenario, title in (("pause", "a pause"), ("restart", "a new run")):
        for row in pick(rows, scenario=scenario):
            origin = row["origin"]
            lines.append(
                [
                    f"{row['viewers']:,}",
                    row["cache"],
                    title,
                    f"{origin['segments']}",
                    f"{origin['segment'] + origin['other']} ({requests_a_segment(row):.2f})",
                    f"{origin['not-yet']}",
                    f"{origin['next']}",
                    f"{trouble(row):.0f}",
                    f"{row['least']}",
                ]
            )
    return table(TROUBLE, lines)


def make_bytes(rows: Sequence[Row]) -> str:
    live = pick(rows, scenario="bytes", cache="WebSocket")
    lines = []
    for row in pick(rows, scenario="bytes"):
        ratio = median(row["bytes_s"] / each["bytes_s"] for each in live)
        name = "WebSocket" if row["cache"] == "WebSocket" else f"lane, {row['cache']}"
        figures = [f"{part:,.0f}" for part in row["parts_s"]]
        lines.append([name, *figures, f"**{row['bytes_s']:,.0f}**", f"{ratio:.2f}"])
    head = ["at 30 Hz", "frames or segments", "status or HTTP headers", "TLS, TCP and IP"]
    drawn = "<!-- bars: ../img/lane-bytes.svg | Traffic to one viewer at 30 Hz | bytes a second | B/s -->"
    return f"{drawn}\n\n{table([*head, 'bytes a second', '÷ WebSocket'], lines)}"


def find_goals(rows: Sequence[Row]) -> list[Goal]:
    """What the issue asks for, as far as it was measured."""
    found: list[Goal] = []
    crowds = list_crowds(rows) or [0]
    few, many = crowds[0], crowds[-1]
    for cache in list_caches(rows):
        mine = pick(rows, cache=cache)
        for scenario in ("steady", "pause", "restart"):
            asked = [max(map(requests_a_segment, pick(mine, scenario=scenario)), default=-1.0)]
            name = f"{cache}: origin requests per segment, {scenario}, worst"
            found += [Goal(name, REQUESTS_GOAL, asked)] if asked[0] >= 0 else []
        for viewers in crowds:
            ages = [row["age_ms"]["p95"] / 1e3 for row in pick(mine, scenario="steady", viewers=viewers)]
            name = f"{cache}: delay of {viewers:,} viewers, p95, s"
            found += [Goal(name, KEY_INTERVAL_S + BEHIND_S, ages)] if ages else []
        live = pick(rows, scenario="bytes", cache="WebSocket")
        lane = pick(mine, scenario="bytes")
        ratios = [a["bytes_s"] / b["bytes_s"] for a, b in zip(lane, live, strict=False)]
        found += [Goal(f"{cache}: bytes per viewer ÷ WebSocket", BYTES_GOAL, ratios)] if ratios else []
        bad = [max(map(trouble, mine))]
        found.append(Goal(f"{cache}: refused, lost, duplicated, gaps", 0, bad, digits=0))
    compared = f"{many:,} ÷ {few:,} viewers per cache"
    asked, whole = list[float](), list[float]()
    for number in sorted({row["round"] for row in pick(rows, scenario="steady")}):
        fewer, more = (pick(rows, scenario="steady", round=number, viewers=v) for v in (few, many))
        asked.append(sum(map(request_ms, more)) / sum(map(request_ms, fewer)))
        whole.append(more[0]["cpu_ms"] / fewer[0]["cpu_ms"])
    if asked:
        found.append(Goal(f"origin CPU per segment, {compared}", CPU_GOAL, asked))
        found.append(Goal(f"total origin CPU, {compared}", CPU_GOAL, whole))
    paused = pick(rows, scenario="pause")
    longest = [row["origin"]["not-yet"] / (row.get("pause_s", PAUSE_S) / HELD_S) for row in paused]
    if longest:
        found.append(Goal(f"“not yet” per cache ÷ (pause ÷ {HELD_S:.0f} s), worst", 1, [max(longest)]))
    return found


def make_goals(goals: Sequence[Goal]) -> str:
    """A line for each goal, with the figures of all caches that have it."""
    found: dict[tuple[str, float], list[tuple[str, Goal]]] = {}
    for goal in goals:
        cache, _, name = goal.name.rpartition(": ")
        found.setdefault((name, goal.limit), []).append((cache, goal))
    lines = [
        [
            name,
            f"≤ {limit:g}",
            ", ".join(f"{cache} **{spread(goal.values, goal.digits)}**".strip() for cache, goal in mine),
            "reached" if all(goal.reached for _, goal in mine) else "**missed**",
        ]
        for (name, limit), mine in found.items()
    ]
    return table(["goal, within one run", "limit", "median (least–most)", "result"], lines)
