"""What a crowd of viewers takes and costs, by WebSocket and by the lane: arithmetic on what was measured.

Everything assumed is a constant here, with where it comes from. `python -m tools.scaling` writes tables and
plots of it.
"""

from __future__ import annotations

from math import ceil, floor
from typing import NamedTuple

# ---- measured: docs/reference/benchmarks.md ----------------------------------------------------

# 1,000 viewers × 30 Hz × 200 B on one core, frames read at once, loopback
CPU_US_PER_MESSAGE = 8.3
RSS_MB_PER_1000 = 9.3
HANDSHAKES_PER_S = 3334.0

# the lane there, a relay that answers one nginx and one Varnish: 0.67 to 0.81 ms
ORIGIN_MS_PER_ANSWER = 0.8

# ---- measured: python -m tools.segment_bytes ------------------------------------------

# of a humanoid of 40 joints and 244 values, by set and frames a second: a frame, KEYs (one in 4 s) included
FRAME_BYTES = {
    ("idle", 10): 58.1, ("idle", 30): 53.1, ("arm", 10): 84.0, ("arm", 30): 79.5,
    ("walk", 10): 126.9, ("walk", 30): 123.1, ("mixed", 10): 90.2, ("mixed", 30): 85.8,
}  # fmt: skip
# a segment of so many seconds, KEYs as far apart. A relay closes one after 6 s at most, so the one of 10 s is
# hypothetical: written by the same code with that bound raised
SEGMENT_BYTES = {
    ("idle", 10, 2): 1549.0, ("idle", 10, 4): 2721.0, ("idle", 10, 10): 6418.0,
    ("idle", 30, 2): 3844.0, ("idle", 30, 4): 7343.0, ("idle", 30, 10): 18370.0,
    ("arm", 10, 2): 2006.0, ("arm", 10, 4): 3778.0, ("arm", 10, 10): 9472.0,
    ("arm", 30, 2): 5244.0, ("arm", 30, 4): 10554.0, ("arm", 30, 10): 27383.0,
    ("walk", 10, 2): 2912.0, ("walk", 10, 4): 5498.0, ("walk", 10, 10): 13589.0,
    ("walk", 30, 2): 8020.0, ("walk", 30, 4): 15800.0, ("walk", 30, 10): 40207.0,
    ("mixed", 10, 2): 2163.0, ("mixed", 10, 4): 4032.0, ("mixed", 10, 10): 10111.0,
    ("mixed", 30, 2): 5712.0, ("mixed", 30, 4): 11318.0, ("mixed", 30, 10): 29575.0,
}  # fmt: skip
MIXED = "mixed"  # a third each of standing, moving its arms and walking: what is counted with here

# ---- measured: one relay with the demo robot, nginx 1.22 before it, curl ---------------

# headers and TLS of one answer of nginx by HTTP/1.1, bytes counted by a proxy in between, 20 answers on one
# connection; by hand
ANSWER_BYTES = 444.0
NGINX_US_PER_ANSWER = 30.0  # CPU of its worker, TLS and HTTP/1.1, 11.6 kB from its cache: 28 to 32
# the page in Chromium, 0.32 MB by nginx's log, and the demo's model at its highest level, 0.22 MB
NEWCOMER_BYTES = 540_000.0
NEWCOMER_REQUESTS = 60.0

# ---- the relay's and the page's own numbers --------------------------------------------

VIEWERS_PER_PROCESS_MAX = 5000
# A relay that goes moves its viewers away at this pace, or within so long; each comes back at once
DRAIN_PER_S = 100.0
DRAIN_S = 6.5
BACKOFF_S = 0.5  # a page whose relay died: at a random moment of so long, then twice that …
# Of very many who are in the lane because a relay is full each tries a socket every 10 to 20 min: the relay
# says 10 min at most (core/policy/lane.py), and a page waits that × (1 to 2)
LANE_RETRY_S = 900.0

# ---- by the protocols -------------------------------------------------------------------

WEBSOCKET_BYTES = 2.0
TLS_BYTES = 22.0  # TLS 1.3, AES-GCM: record header, type, tag
TLS_RECORD_BYTES_MAX = 16_384
TCP_IP_BYTES = 52.0  # IPv4 and TCP with timestamps; one frame, one packet
TCP_PAYLOAD_BYTES = 1448.0  # of a full packet
STATUS_BYTES_PER_S = 100.0  # one status a second, most of them in a frame's packet
JOIN_BYTES = 10_000.0  # hello, schema, KEY, newest; the page and the model come from a cache

# ---- chosen -----------------------------------------------------------------------------

CORE_SHARE = 0.6  # of a core, so that a burst of joins and a neighbour fit beside the fan-out
PROCESS_MB = 60.0  # a relay without viewers
INSTANCE_MB = 512.0  # the memory that one gateway is rented with
NODES = 200  # caches that ask the origin, once for each segment: a CDN without a shield
BEHIND_S = 0.7  # beside a segment's length, p95: the goal of `make lane`
CACHE_GBIT_S = 0.6  # of a rented server's line of 1 Gbit/s
RETRIES_SHARE = 0.1  # of the handshakes of one process, for pages in the lane that try a socket

# ---- prices: orders of magnitude of public lists, US$, August to October 2026; put yours here ---

CLOUD_GB = 0.085  # egress of a large cloud
FLAT_GB = 0.0012  # egress of a server rented by the month, 20 TB included
CORE_HOUR = 0.04  # one virtual core with its memory


class Provider(NamedTuple):
    """Who serves the lane's answers. `is_own`: caches on rented servers, paid by the hour and FLAT_GB."""

    name: str
    per_gb: float
    per_million: float
    is_own: bool = False


# CDNs that charge traffic alone: $0.005 to $0.06 a GB, by region and network
BYTES = Provider("bytes", 0.01, 0.0)
# an object store or functions at the edge whose traffic is free: $0.30 to $0.36 a million
REQUESTS = Provider("requests", 0.0, 0.30)
# CDNs of large clouds, and others: in Europe and North America $0.08 to $0.12 a GB, $0.75 to $1.00 a million
BOTH = Provider("bytes + requests", 0.085, 1.00)
# nginx or Varnish on your own servers
NEITHER = Provider("server-hours", FLAT_GB, 0.0, is_own=True)
PROVIDERS = (BOTH, REQUESTS, BYTES, NEITHER)


# ---- by WebSocket -----------------------------------------------------------------------


def compute_frame_bytes(hz: float) -> float:
    """A frame of the mixed set: seldom ones are larger, since more has changed."""
    return FRAME_BYTES[MIXED, 10 if hz <= 10 else 30]


def compute_socket_bytes_per_s(hz: float, frame_bytes: float | None = None) -> float:
    """To one viewer, everything on top included."""
    frame = compute_frame_bytes(hz) if frame_bytes is None else frame_bytes
    return hz * (frame + WEBSOCKET_BYTES + TLS_BYTES + TCP_IP_BYTES) + STATUS_BYTES_PER_S


def count_viewers_per_process(hz: float) -> int:
    """The least of what CPU, memory and the setting `--max-viewers` allow."""
    by_cpu = CORE_SHARE * 1e6 / (CPU_US_PER_MESSAGE * hz)
    by_memory = (INSTANCE_MB - PROCESS_MB) / RSS_MB_PER_1000 * 1000
    return int(min(by_cpu, by_memory, VIEWERS_PER_PROCESS_MAX))


def count_processes(viewers: float, hz: float) -> int:
    """Gateways, or one relay of role `all`. Where there are several, one more, which may be replaced."""
    needed = ceil(viewers / count_viewers_per_process(hz))
    return needed if needed == 1 else needed + 1


def compute_socket_cores(viewers: float, hz: float) -> float:
    """Cores that are busy with the fan-out."""
    return viewers * hz * CPU_US_PER_MESSAGE / 1e6


def compute_socket_gb_per_h(viewers: float, hz: float) -> float:
    """Egress, in GB an hour."""
    return viewers * compute_socket_bytes_per_s(hz) * 3600 / 1e9


def compute_socket_cost_per_h(viewers: float, hz: float, gb: float) -> float:
    """US$ for an hour: cores and egress at `gb` each GB."""
    return count_processes(viewers, hz) * CORE_HOUR + compute_socket_gb_per_h(viewers, hz) * gb


# ---- by the lane ------------------------------------------------------------------------


def compute_answer_bytes(segment_bytes: float) -> float:
    """One segment on the line: with headers, TLS, TCP and IP."""
    sent = segment_bytes + ANSWER_BYTES + floor(segment_bytes / TLS_RECORD_BYTES_MAX) * TLS_BYTES
    return sent + ceil(sent / TCP_PAYLOAD_BYTES) * TCP_IP_BYTES


def compute_lane_bytes_per_s(hz: int, segment_s: int, motion: str = MIXED) -> float:
    """To one viewer, everything on top included."""
    return compute_answer_bytes(SEGMENT_BYTES[motion, hz, segment_s]) / segment_s


def compute_lane_gb_per_h(viewers: float, hz: int, segment_s: int) -> float:
    """Egress of the caches, in GB an hour."""
    return viewers * compute_lane_bytes_per_s(hz, segment_s) * 3600 / 1e9


def compute_lane_requests_per_h(viewers: float, segment_s: int) -> float:
    """Requests that caches answer."""
    return viewers * 3600 / segment_s


def compute_origin_requests_per_s(viewers: float, segment_s: int) -> float:
    """Requests that reach the relay: one for each segment and cache."""
    return min(viewers, NODES) / segment_s


def compute_origin_cores(viewers: float, segment_s: int) -> float:
    """Cores of the relay that are busy with the lane."""
    return compute_origin_requests_per_s(viewers, segment_s) * ORIGIN_MS_PER_ANSWER / 1e3


def count_origin_processes(viewers: float, segment_s: int) -> int:
    """Relays that the caches need."""
    return ceil(compute_origin_cores(viewers, segment_s) / CORE_SHARE)


def compute_origin_gb_per_h(viewers: float, hz: int, segment_s: int) -> float:
    """Egress of the relay to the caches, in GB an hour."""
    return compute_lane_gb_per_h(min(viewers, NODES), hz, segment_s)


def count_own_caches(viewers: float, hz: int, segment_s: int) -> int:
    """Rented servers with a cache, by their line and by their core; where there are several, one more."""
    by_line = viewers * compute_lane_bytes_per_s(hz, segment_s) * 8 / 1e9 / CACHE_GBIT_S
    by_core = viewers / segment_s * NGINX_US_PER_ANSWER / 1e6 / CORE_SHARE
    needed = ceil(max(by_line, by_core))
    return needed if needed == 1 else needed + 1


def compute_lane_cost_per_h(viewers: float, hz: int, segment_s: int, provider: Provider) -> float:
    """US$ for an hour: caches, and the relay with what it sends them."""
    gb = compute_lane_gb_per_h(viewers, hz, segment_s)
    millions = compute_lane_requests_per_h(viewers, segment_s) / 1e6
    cost = CORE_HOUR + gb * provider.per_gb + millions * provider.per_million
    if not provider.is_own:
        return cost + compute_origin_gb_per_h(viewers, hz, segment_s) * CLOUD_GB
    caches = count_own_caches(viewers, hz, segment_s)
    return cost + caches * CORE_HOUR + compute_lane_gb_per_h(caches, hz, segment_s) * FLAT_GB


def count_retrying_viewers() -> int:
    """How many pages in the lane may try a socket at one process, which spends RETRIES_SHARE on them."""
    return int(RETRIES_SHARE * HANDSHAKES_PER_S * LANE_RETRY_S)


# ---- storms -----------------------------------------------------------------------------


def compute_deploy_share(viewers: float, hz: float) -> float:
    """One process is replaced: the share of what the others can shake that its viewers take, at the peak.

    A single process is its own successor."""
    count = count_processes(viewers, hz)
    moved = min(viewers, viewers / count)
    return moved / min(DRAIN_S, moved / DRAIN_PER_S) / (HANDSHAKES_PER_S * max(1, count - 1))


def compute_last_back_s(returning: float, serving: int) -> float:
    """So many come back at once to so many processes: when the last has shaken hands."""
    return max(BACKOFF_S, returning / (serving * HANDSHAKES_PER_S))


def compute_half_dies_s(viewers: float, hz: float) -> float:
    """Half of the processes die at once, a single one with a successor ready: when the last is back."""
    count = count_processes(viewers, hz)
    dead = ceil(count / 2)
    return compute_last_back_s(viewers * dead / count, max(1, count - dead))
