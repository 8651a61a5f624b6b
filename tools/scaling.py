"""Calculates processes, traffic and prices, from the cost of one message to a million viewers.

python -m tools.scaling [--out DIR]: writes the plots (docs/img/scaling-*.svg) and the tables between the
markers of docs/reference/capacity.md. tools/crowd.py has the assumptions.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from tools import crowd, plot
from tools.crowd import MIXED, PROVIDERS
from tools.pages import fill, table

ROOT = Path(__file__).resolve().parent.parent

MEASURED = ROOT / "relay/benches/lane/measured.json"
RATE_HZ = 10.0
LANE_HZ = 30  # the rate of a robot in the lane
SEGMENTS_S = (2, 4, 10)
Row = tuple[str, Callable[[int, int], float]]  # its name, and a figure for this many viewers and one case
LENGTHS = " · ".join(f"{s}" for s in SEGMENTS_S)  # the rows with three figures in a cell
SEGMENT_S = 4
SOCKETS_HZ = (10, 30)
MILLION = 1_000_000
CROWDS = (1_000, 10_000, 100_000, MILLION)
CURVE = tuple(round(10 ** (3 + i / 8)) for i in range(25))
MOTIONS = ("idle", "arm", MIXED, "walk")


def number(value: float) -> str:
    """More than three digits would suggest false precision."""
    if value >= 100:
        return f"{float(f'{value:.3g}'):,.0f}"
    return f"{float(f'{value:.2g}'):g}"


def crowds(name: str, figure: Callable[[int], str]) -> list[str]:
    return [name, *(figure(viewers) for viewers in CROWDS)]


def of_crowds(rows: Sequence[Sequence[str]]) -> str:
    return table(["viewers", *(f"{v:,}" for v in CROWDS)], rows)


def of_transports(sockets: Sequence[Row], lane: Sequence[Row]) -> str:
    """Rows for both; each cell has a figure for each rate, or for each segment length."""
    rates = " · ".join(f"{hz}" for hz in SOCKETS_HZ)
    rows: list[list[str]] = []
    for name, cases, given in (
        (f"WebSocket, {rates} Hz", SOCKETS_HZ, sockets),
        (f"lane, {LENGTHS} s", SEGMENTS_S, lane),
    ):
        for number_of, (said, figure) in enumerate(given):
            cells = (each(figure(v, case) for case in cases) for v in CROWDS)
            rows.append(["" if number_of else name, said, *cells])
    return table(["", "viewers", *(f"{v:,}" for v in CROWDS)], rows)


def each(values: Iterable[float]) -> str:
    """Several figures in one cell, in the order given in the row's name."""
    return " · ".join(map(number, values))


# ---- the tables -------------------------------------------------------------------------


def sizes() -> str:
    """Bytes per second for one viewer, by the robot's motion."""
    rows = []
    for hz in SOCKETS_HZ:
        for motion in MOTIONS:
            frame = crowd.FRAME_BYTES[motion, hz]
            by_socket = crowd.compute_socket_bytes_per_s(hz, frame)
            by_lane = [crowd.compute_lane_bytes_per_s(hz, s, motion) for s in SEGMENTS_S]
            segments = [f"{crowd.SEGMENT_BYTES[motion, hz, s] / 1000:.1f}" for s in SEGMENTS_S]
            shares = [f"{rate:,.0f} ({rate / by_socket:.2f})" for rate in by_lane]
            rows.append([motion, f"{hz}", f"{frame:.0f}", " · ".join(segments), f"{by_socket:,.0f}", *shares])
    head = ["robot", "Hz", "frame, B", f"segment, kB: {' · '.join(f'{s} s' for s in SEGMENTS_S)}"]
    return table([*head, "WebSocket, B/s", *(f"lane, {s} s, B/s" for s in SEGMENTS_S)], rows)


def counted() -> str:
    """The measurements of the lane benchmark, and the same figures calculated."""
    found = json.loads(MEASURED.read_text())
    caches, hz = list(found["lane_bytes_s"]), found["hz"]
    rates = [found["websocket_bytes_s"], *(found["lane_bytes_s"][name] for name in caches)]
    reckoned = [crowd.compute_socket_bytes_per_s(hz)]
    reckoned += [crowd.compute_lane_bytes_per_s(hz, SEGMENT_S)] * len(caches)
    rows = [
        ["measured, B/s per viewer", *(f"{rate:,}" for rate in rates)],
        ["calculated, B/s per viewer", *(f"{rate:,.0f}" for rate in reckoned)],
        ["measured ÷ calculated − 1", *(f"{a / b - 1:+.1%}" for a, b in zip(rates, reckoned, strict=True))],
        ["headers of an answer, B", "–", *(f"{found['header_bytes'][name]}" for name in caches)],
        [
            "delay beyond the segment's length, p95, s",
            "–",
            *(f"{found['behind_p95_s'][name] - SEGMENT_S:.2f}" for name in caches),
        ],
    ]
    return table([found["machine"]["day"], "WebSocket", *(f"lane, {name}" for name in caches)], rows)


def limits() -> str:
    rows = []
    for hz in (1.0, 10.0, 30.0, 60.0):
        by_cpu = crowd.CORE_SHARE * 1e6 / (crowd.CPU_US_PER_MESSAGE * hz)
        by_memory = (crowd.INSTANCE_MB - crowd.PROCESS_MB) / crowd.RSS_MB_PER_1000 * 1000
        viewers = crowd.count_viewers_per_process(hz)
        mbit_s = viewers * crowd.compute_socket_bytes_per_s(hz) * 8 / 1e6
        rows.append(
            [f"{hz:g} Hz", number(by_cpu), number(by_memory), number(crowd.VIEWERS_PER_PROCESS_MAX),
             f"**{viewers:,}**", number(mbit_s)]
        )  # fmt: skip
    return table(["rate", "by CPU", "by memory", "by `--max-viewers`", "viewers per process", "Mbit/s"], rows)


def origin() -> str:
    """The relays' work, and the requests that reach them."""
    return of_transports(
        [
            ("messages a second", lambda v, hz: v * hz),
            ("processes, one core each", crowd.count_processes),
            ("busy cores", crowd.compute_socket_cores),
        ],
        [
            ("requests a second to the caches", lambda v, s: v / s),
            (f"of these, from {crowd.NODES} caches to the relay", crowd.compute_origin_requests_per_s),
            ("processes, one core each", crowd.count_origin_processes),
            ("busy cores", crowd.compute_origin_cores),
        ],
    )


def traffic() -> str:
    """Bytes from the origin and to the viewers, and requests."""
    return of_transports(
        [
            ("from the relays, Gbit/s", lambda v, hz: as_gbit_s(crowd.compute_socket_gb_per_h(v, hz))),
            ("the same, GB an hour", crowd.compute_socket_gb_per_h),
        ],
        [
            ("from the caches, Gbit/s", lambda v, s: as_gbit_s(crowd.compute_lane_gb_per_h(v, LANE_HZ, s))),
            ("the same, GB an hour", lambda v, s: crowd.compute_lane_gb_per_h(v, LANE_HZ, s)),
            ("million requests an hour", lambda v, s: crowd.compute_lane_requests_per_h(v, s) / 1e6),
            (
                f"from the relay to {crowd.NODES} caches, Gbit/s",
                lambda v, s: as_gbit_s(crowd.compute_origin_gb_per_h(v, LANE_HZ, s)),
            ),
        ],
    )


def as_gbit_s(gb_per_h: float) -> float:
    return gb_per_h * 8 / 3600


def cost() -> str:
    """US$ per hour for each crowd."""

    def by_socket(gb: float) -> Callable[[int], str]:
        return lambda v: each(crowd.compute_socket_cost_per_h(v, hz, gb) for hz in SOCKETS_HZ)

    def by_lane(provider: crowd.Provider) -> Callable[[int], str]:
        return lambda v: each(crowd.compute_lane_cost_per_h(v, hz, SEGMENT_S, provider) for hz in SOCKETS_HZ)

    clouds = (("in a large cloud", crowd.CLOUD_GB), ("on rented servers", crowd.FLAT_GB))
    rows = [crowds(f"WebSocket, {where}", by_socket(gb)) for where, gb in clouds]
    rows += [crowds(f"lane, billed by {provider.name}", by_lane(provider)) for provider in PROVIDERS]
    return of_crowds(rows)


def million() -> str:
    """US$ per hour for a million viewers in the lane, by provider and segment length."""
    rows = []
    for provider in PROVIDERS:
        row = [provider.name]
        for hz in SOCKETS_HZ:
            costs = [number(crowd.compute_lane_cost_per_h(MILLION, hz, s, provider)) for s in SEGMENTS_S]
            least = min(costs, key=lambda said: float(said.replace(",", "")))
            row += [f"**{said}**" if said == least else said for said in costs]
        rows.append(row)
    gb, requests = crowd.NEWCOMER_BYTES * MILLION / 1e9, crowd.NEWCOMER_REQUESTS * MILLION / 1e6
    for row, provider in zip(rows, PROVIDERS, strict=True):
        row.append(number(gb * provider.per_gb + requests * provider.per_million))
    behind = ["delay, s", *(f"{s + crowd.BEHIND_S:g}" for _ in SOCKETS_HZ for s in SEGMENTS_S), "–"]
    names = [f"{s} s, {hz} Hz" for hz in SOCKETS_HZ for s in SEGMENTS_S]
    return table(["billed by", *names, "page and model, once"], [*rows, behind])


def storms() -> str:
    hz = RATE_HZ
    rows = [
        crowds(
            "one process is replaced: share of the others' handshake capacity",
            lambda v: f"{crowd.compute_deploy_share(v, hz):.1%}",
        ),
        crowds(
            "schemas and frames for the returning viewers, MB",
            lambda v: number(v / crowd.count_processes(v, hz) * crowd.JOIN_BYTES / 1e6),
        ),
        crowds(
            "half of the processes die at once: last viewer back after, s",
            lambda v: number(crowd.compute_half_dies_s(v, hz)),
        ),
        crowds(
            "all die, and their successors are ready: last viewer back after, s",
            lambda v: number(crowd.compute_last_back_s(v, crowd.count_processes(v, hz))),
        ),
    ]
    return of_crowds(rows)


def capacity() -> str:
    """For operators: one process on one core, and a thousand viewer-hours."""
    rows = []
    for hz in (1.0, 10.0, 30.0):
        viewers = crowd.count_viewers_per_process(hz)
        gb_per_1000 = crowd.compute_socket_gb_per_h(1000, hz)
        cores = 1000 / viewers * crowd.CORE_HOUR
        memory_mb = crowd.PROCESS_MB + viewers / 1000 * crowd.RSS_MB_PER_1000
        costs = [f"{cores + gb_per_1000 * gb:.2f}" for gb in (crowd.CLOUD_GB, crowd.FLAT_GB)]
        mbit_s = crowd.compute_socket_gb_per_h(viewers, hz) / 3600 * 8000
        figures = [number(memory_mb), number(mbit_s), number(gb_per_1000)]
        rows.append([f"{hz:g} Hz", f"{viewers:,}", *figures, *costs])
    head = ["rate", "viewers per process", "memory, MB", "Mbit/s", "GB"]
    return table([*head, "large cloud, US$", "rented servers, US$"], rows)


# ---- plots and pages -----------------------------------------------------------------------


def plots() -> dict[str, str]:
    """File name → SVG."""
    busy = [
        plot.Line(f"WebSocket, {hz} Hz", [(v, crowd.compute_socket_cores(v, hz)) for v in CURVE])
        for hz in reversed(SOCKETS_HZ)
    ]
    busy += [
        plot.Line(f"lane, {SEGMENT_S} s", [(v, crowd.compute_origin_cores(v, SEGMENT_S)) for v in CURVE])
    ]
    prices = [
        plot.Line(name, [(v, crowd.compute_socket_cost_per_h(v, LANE_HZ, gb)) for v in CURVE])
        for name, gb in (("WebSocket, cloud", crowd.CLOUD_GB), ("WebSocket, rented", crowd.FLAT_GB))
    ]
    prices += [
        plot.Line(
            f"lane: {provider.name}",
            [(v, crowd.compute_lane_cost_per_h(v, LANE_HZ, SEGMENT_S, provider)) for v in CURVE],
        )
        for provider in PROVIDERS
    ]
    prices.sort(key=lambda line: line.points[-1][1], reverse=True)  # each label at its line's end
    return {
        "scaling-origin.svg": plot.lines(
            f"CPU cores that the relays use, with {crowd.NODES} caches", "viewers", "cores", busy
        ),
        "scaling-cost.svg": plot.lines(
            f"Cost of one robot at {LANE_HZ} Hz, segments of {SEGMENT_S} s",
            "viewers",
            "US$ an hour",
            prices,
        ),
    }


PAGE = "reference/capacity.md"
BLOCKS = (capacity, counted, sizes, limits, origin, traffic, cost, million, storms)


def written(page: str) -> str:
    """The page with regenerated blocks. Raises ValueError if a marker is missing."""
    return fill(page, {block.__name__: block() for block in BLOCKS}, PAGE)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs", help="output folder (docs/)")
    write(parser.parse_args().out)


def write(out: Path) -> None:
    """Write pages and plots below `out`."""
    for folder in ("img", "reference"):
        (out / folder).mkdir(parents=True, exist_ok=True)
    (out / PAGE).write_text(written((ROOT / "docs" / PAGE).read_text()))
    for name, image in plots().items():
        (out / "img" / name).write_text(image)


if __name__ == "__main__":
    main()
