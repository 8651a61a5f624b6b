"""How many processes, how much traffic, what price: from the cost of one message to a million viewers.

python -m tools.scaling [--out DIR]: writes the plots (docs/img/scaling-*.svg) and the tables between the
markers of docs/SCALING.md and docs/OPERATIONS.md. Everything assumed is a constant here, with where it
comes from.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from math import ceil
from pathlib import Path

from tools import plot

ROOT = Path(__file__).resolve().parent.parent

# measured, docs/BENCHMARKS.md: 1,000 viewers × 30 Hz × 200 B on one core, frames read at once, loopback
CPU_US_PER_MESSAGE = 8.3
RSS_MB_PER_1000 = 9.3
HANDSHAKES_PER_S = 3334.0
# measured, `make bytes` and facts of the wire study: a walking robot at 10 of 30 Hz, KEYs included
FRAME_BYTES = 90.0
# relay, Limits and Drain
VIEWERS_PER_PROCESS_MAX = 5000
DRAIN_S = 6.5
RETURN_SPREAD_S = 10.0  # a page moved away (1012) comes back at a random moment of so long
BACKOFF_S = 0.5  # a page whose relay died: at a random moment of so long, then twice that …
# by the protocols
WEBSOCKET_BYTES = 2.0
TLS_BYTES = 22.0  # TLS 1.3, AES-GCM: record header, type, tag
TCP_IP_BYTES = 52.0  # IPv4 and TCP with timestamps; one frame, one packet
STATUS_BYTES_PER_S = 100.0  # one status a second, most of them in a frame's packet
JOIN_BYTES = 10_000.0  # hello, schema, KEY, newest; the page and the model come from a cache
# chosen
CORE_SHARE = 0.6  # of a core, so that a burst of joins and a neighbour fit beside the fan-out
PROCESS_MB = 60.0  # a relay without viewers
INSTANCE_MB = 512.0  # the memory that one gateway is rented with
# prices: orders of magnitude of public price lists, US$; put yours here
CLOUD_GB = 0.085  # egress of a large cloud
FLAT_GB = 0.0012  # egress of a server rented by the month, 20 TB included
CORE_HOUR = 0.04  # one virtual core with its memory
CDN_GB = 0.01  # a CDN that charges for bytes
# segments behind a CDN (not built): 4 s of frames as one cacheable object
SEGMENT_S = 4.0
SEGMENT_HEADER_BYTES = 300.0

RATE_HZ = 10.0
CROWDS = (1_000, 10_000, 100_000, 1_000_000)
CURVE = tuple(round(10 ** (3 + i / 8)) for i in range(25))


def wire_bytes_per_s(hz: float) -> float:
    """To one viewer, everything on top included."""
    packet = FRAME_BYTES + WEBSOCKET_BYTES + TLS_BYTES + TCP_IP_BYTES
    return hz * packet + STATUS_BYTES_PER_S


def viewers_per_process(hz: float) -> int:
    """The least of what CPU, memory and the setting `--max-viewers` allow."""
    by_cpu = CORE_SHARE * 1e6 / (CPU_US_PER_MESSAGE * hz)
    by_memory = (INSTANCE_MB - PROCESS_MB) / RSS_MB_PER_1000 * 1000
    return int(min(by_cpu, by_memory, VIEWERS_PER_PROCESS_MAX))


def processes(viewers: float, hz: float) -> int:
    """Gateways, or one relay of role `all`. Where there are several, one more, which may be replaced."""
    needed = ceil(viewers / viewers_per_process(hz))
    return needed if needed == 1 else needed + 1


def egress_gbit_s(viewers: float, hz: float) -> float:
    return viewers * wire_bytes_per_s(hz) * 8 / 1e9


def egress_gb_per_h(viewers: float, hz: float) -> float:
    return viewers * wire_bytes_per_s(hz) * 3600 / 1e9


def cost_per_h(viewers: float, hz: float, gb: float) -> float:
    """US$ for an hour: cores and egress at `gb` each GB."""
    return processes(viewers, hz) * CORE_HOUR + egress_gb_per_h(viewers, hz) * gb


def segments_cost_per_h(viewers: float, hz: float) -> float:
    """The same hour in cacheable segments behind a CDN that charges for bytes; the origin costs nothing."""
    per_segment = SEGMENT_S * hz * FRAME_BYTES + SEGMENT_HEADER_BYTES + TLS_BYTES + 2 * TCP_IP_BYTES
    return viewers * per_segment / SEGMENT_S * 3600 / 1e9 * CDN_GB


def deploy_share(viewers: float, hz: float) -> float:
    """One process is replaced: the share of what the others can shake that its viewers take, at the peak.

    A single process is its own successor."""
    count = processes(viewers, hz)
    moved = min(viewers, viewers / count)
    return moved / RETURN_SPREAD_S / (HANDSHAKES_PER_S * max(1, count - 1))


def last_back_s(returning: float, serving: int) -> float:
    """So many come back at once to so many processes: when the last has shaken hands."""
    return max(BACKOFF_S, returning / (serving * HANDSHAKES_PER_S))


def half_dies_s(viewers: float, hz: float) -> float:
    """Half of the processes die at once, a single one with a successor ready: when the last is back."""
    count = processes(viewers, hz)
    dead = ceil(count / 2)
    return last_back_s(viewers * dead / count, max(1, count - dead))


def number(value: float) -> str:
    """Three digits are more than these deserve."""
    if value >= 100:
        return f"{float(f'{value:.3g}'):,.0f}"
    return f"{float(f'{value:.2g}'):g}"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)])


def crowds(name: str, figure: Callable[[int], str]) -> list[str]:
    return [name, *(figure(viewers) for viewers in CROWDS)]


def sizes() -> str:
    hz = RATE_HZ
    rows = [
        crowds("messages a second", lambda v: number(v * hz)),
        crowds("processes, one core each", lambda v: number(processes(v, hz))),
        crowds("the same at 30 Hz", lambda v: number(processes(v, 30))),
        crowds("egress, Gbit/s", lambda v: number(egress_gbit_s(v, hz))),
        crowds("egress, GB an hour", lambda v: number(egress_gb_per_h(v, hz))),
        crowds("memory for viewers, GB", lambda v: number(v * RSS_MB_PER_1000 / 1e6)),
        crowds("an hour in a large cloud, $", lambda v: number(cost_per_h(v, hz, CLOUD_GB))),
        crowds("an hour on rented servers, $", lambda v: number(cost_per_h(v, hz, FLAT_GB))),
        crowds("an hour in segments behind a CDN, $", lambda v: number(segments_cost_per_h(v, hz))),
    ]
    return table(["viewers", *(f"{v:,}" for v in CROWDS)], rows)


def storms() -> str:
    hz = RATE_HZ
    rows = [
        crowds(
            "one process replaced: share of the others' handshakes", lambda v: f"{deploy_share(v, hz):.1%}"
        ),
        crowds(
            "schemas and frames for those who come back, MB",
            lambda v: number(v / processes(v, hz) * JOIN_BYTES / 1e6),
        ),
        crowds(
            "half of the processes die at once: the last one back after, s",
            lambda v: number(half_dies_s(v, hz)),
        ),
        crowds(
            "all die, and their successors are there: after, s",
            lambda v: number(last_back_s(v, processes(v, hz))),
        ),
    ]
    return table(["viewers", *(f"{v:,}" for v in CROWDS)], rows)


def limits() -> str:
    rows = []
    for hz in (1.0, 10.0, 30.0, 60.0):
        by_cpu = CORE_SHARE * 1e6 / (CPU_US_PER_MESSAGE * hz)
        by_memory = (INSTANCE_MB - PROCESS_MB) / RSS_MB_PER_1000 * 1000
        mbit_s = viewers_per_process(hz) * wire_bytes_per_s(hz) * 8 / 1e6
        rows.append(
            [f"{hz:g} Hz", number(by_cpu), number(by_memory), number(VIEWERS_PER_PROCESS_MAX),
             f"**{viewers_per_process(hz):,}**", number(mbit_s)]
        )  # fmt: skip
    return table(
        ["rate", "by CPU", "by memory", "by `--max-viewers`", "viewers of one process", "its Mbit/s"], rows
    )


def capacity() -> str:
    """For who runs it: one process of one core, and a thousand viewer-hours."""
    rows = []
    for hz in (1.0, 10.0, 30.0):
        viewers = viewers_per_process(hz)
        gb_per_1000 = egress_gb_per_h(1000, hz)
        cores = 1000 / viewers * CORE_HOUR
        memory_mb = PROCESS_MB + viewers / 1000 * RSS_MB_PER_1000
        costs = [f"{cores + gb_per_1000 * gb:.2f}" for gb in (CLOUD_GB, FLAT_GB)]
        mbit_s = egress_gbit_s(viewers, hz) * 1000
        figures = [number(memory_mb), number(mbit_s), number(gb_per_1000)]
        rows.append([f"{hz:g} Hz", f"{viewers:,}", *figures, *costs])
    head = ["viewers at", "of one process (one core)", "its MB", "its Mbit/s"]
    return table([*head, "1,000 viewer-hours: GB", "large cloud, $", "rented server, $"], rows)


def plots() -> dict[str, str]:
    """File name → SVG."""
    by_rate = [plot.Line(f"{hz:g} Hz", [(v, processes(v, hz)) for v in CURVE]) for hz in (60.0, 30.0, 10.0)]
    prices = [
        plot.Line("large cloud", [(v, cost_per_h(v, RATE_HZ, CLOUD_GB)) for v in CURVE]),
        plot.Line("segments, CDN", [(v, segments_cost_per_h(v, RATE_HZ)) for v in CURVE]),
        plot.Line("rented servers", [(v, cost_per_h(v, RATE_HZ, FLAT_GB)) for v in CURVE]),
    ]
    return {
        "scaling-processes.svg": plot.lines(
            "Relay processes, one core each", "viewers", "processes", by_rate
        ),
        "scaling-cost.svg": plot.lines("An hour of one robot at 10 Hz", "viewers", "US$ an hour", prices),
    }


BLOCKS: dict[str, dict[str, Callable[[], str]]] = {
    "SCALING.md": {"sizes": sizes, "storms": storms, "limits": limits},
    "OPERATIONS.md": {"capacity": capacity},
}


def written(file: str, page: str) -> str:
    """The page with its blocks made anew. ValueError when a marker is missing."""
    for name, block in BLOCKS[file].items():
        pattern = rf"(<!-- {name}: .*? -->\n).*?(<!-- /{name} -->)"
        page, found = re.subn(pattern, rf"\g<1>\n{block()}\n\n\g<2>", page, flags=re.DOTALL)
        if found != 1:
            raise ValueError(f"{file}: {found} blocks called {name!r}, one is needed")
    return page


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs", help="instead of docs/")
    out: Path = parser.parse_args().out
    (out / "img").mkdir(parents=True, exist_ok=True)
    for file in BLOCKS:
        (out / file).write_text(written(file, (ROOT / "docs" / file).read_text()))
    for name, image in plots().items():
        (out / "img" / name).write_text(image)


if __name__ == "__main__":
    main()
