"""What a crowd of viewers needs and costs, by WebSocket and by the lane, calculated from measurements.

Every assumption is a constant here, with its source. `python -m tools.scaling` writes tables and plots from
it.
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

# for a humanoid with 40 joints and 244 values, by set and frames a second: one frame, KEYs (one in 4 s)
# included
FRAME_BYTES = {
    ("idle", 10): 58.1, ("idle", 30): 53.1, ("arm", 10): 84.0, ("arm", 30): 79.5,
    ("walk", 10): 126.9, ("walk", 30): 123.1, ("mixed", 10): 90.2, ("mixed", 30): 85.8,
}  # fmt: skip
# a segment of this many seconds, with a KEY at its start only. A relay closes one after 6 s at most, so the
# 10 s ones are hypothetical: written by the same code with a higher limit
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
MIXED = "mixed"  # a third each of standing, moving its arms and walking: used for all calculations

# ---- measured: one relay with the demo robot, nginx 1.22 before it, curl ---------------

# headers and TLS of one answer from nginx over HTTP/1.1, bytes counted by a proxy in between, 20 answers on
# one connection; measured by hand
ANSWER_BYTES = 444.0
NGINX_US_PER_ANSWER = 30.0  # CPU of its worker, TLS and HTTP/1.1, 11.6 kB from its cache: 28 to 32
# the page in Chromium, 0.32 MB by nginx's log, and the demo's model at its highest level, 0.22 MB
NEWCOMER_BYTES = 540_000.0
NEWCOMER_REQUESTS = 60.0

# ---- settings of the relay and the page -------------------------------------------------

VIEWERS_PER_PROCESS_MAX = 5000
# A relay that shuts down moves its viewers away at this pace, or within this time; each returns at once
DRAIN_PER_S = 100.0
DRAIN_S = 6.5
BACKOFF_S = 0.5  # a page whose relay died retries at a random moment within this time, then twice that …
# If very many viewers are in the lane because a relay is full, each tries a socket every 10 to 20 min: the
# relay says 10 min at most (core/policy.py), and a page waits that × (1 to 2)
LANE_RETRY_S = 900.0

# ---- protocol overhead ------------------------------------------------------------------

WEBSOCKET_BYTES = 2.0
TLS_BYTES = 22.0  # TLS 1.3, AES-GCM: record header, type, tag
TLS_RECORD_BYTES_MAX = 16_384
TCP_IP_BYTES = 52.0  # IPv4 and TCP with timestamps; one frame, one packet
TCP_PAYLOAD_BYTES = 1448.0  # in a full packet
STATUS_BYTES_PER_S = 100.0  # one status a second, most of them in a frame's packet
JOIN_BYTES = 10_000.0  # hello, schema, KEY, newest; the page and the model come from a cache

# ---- design choices ---------------------------------------------------------------------

CORE_SHARE = 0.6  # of a core, to leave room for bursts of joins and for other processes
PROCESS_MB = 60.0  # a relay without viewers
INSTANCE_MB = 512.0  # the memory of one rented gateway
NODES = 200  # caches that request each segment once from the origin: a CDN without a shield
BEHIND_S = 0.7  # in addition to a segment's length, p95: the goal of `make lane`
CACHE_GBIT_S = 0.6  # of a rented server's 1 Gbit/s link
RETRIES_SHARE = 0.1  # of one process's handshakes, for pages in the lane that try a socket

# ---- prices: orders of magnitude from public lists, US$, August to October 2026; use your own ---

CLOUD_GB = 0.085  # egress of a large cloud
FLAT_GB = 0.0012  # egress of a server rented by the month, with 20 TB included
CORE_HOUR = 0.04  # one virtual core with its memory


class Provider(NamedTuple):
    """A provider that serves the lane. `is_own`: caches on rented servers, paid by the hour and FLAT_GB."""

    name: str
    per_gb: float
    per_million: float
    is_own: bool = False


# CDNs that charge for traffic only: $0.005 to $0.06 per GB, by region and network
BYTES = Provider("bytes", 0.01, 0.0)
# an object store or edge functions with free traffic: $0.30 to $0.36 per million requests
REQUESTS = Provider("requests", 0.0, 0.30)
# CDNs of large clouds, and others: in Europe and North America $0.08 to $0.12 per GB, $0.75 to $1.00 per
# million
BOTH = Provider("bytes + requests", 0.085, 1.00)
# nginx or Varnish on your own servers
NEITHER = Provider("server-hours", FLAT_GB, 0.0, is_own=True)
PROVIDERS = (BOTH, REQUESTS, BYTES, NEITHER)


# ---- by WebSocket -----------------------------------------------------------------------


def compute_frame_bytes(hz: float) -> float:
    """A frame of the mixed set; at low rates frames are larger, because more has changed in between."""
    return FRAME_BYTES[MIXED, 10 if hz <= 10 else 30]


def compute_socket_bytes_per_s(hz: float, frame_bytes: float | None = None) -> float:
    """Bytes to one viewer, including all overhead."""
    frame = compute_frame_bytes(hz) if frame_bytes is None else frame_bytes
    return hz * (frame + WEBSOCKET_BYTES + TLS_BYTES + TCP_IP_BYTES) + STATUS_BYTES_PER_S


def count_viewers_per_process(hz: float) -> int:
    """The minimum of what CPU, memory and `--max-viewers` allow."""
    by_cpu = CORE_SHARE * 1e6 / (CPU_US_PER_MESSAGE * hz)
    by_memory = (INSTANCE_MB - PROCESS_MB) / RSS_MB_PER_1000 * 1000
    return int(min(by_cpu, by_memory, VIEWERS_PER_PROCESS_MAX))


def count_processes(viewers: float, hz: float) -> int:
    """Gateways, or one relay with role `all`. If there are several, one spare is added for replacements."""
    needed = ceil(viewers / count_viewers_per_process(hz))
    return needed if needed == 1 else needed + 1


def compute_socket_cores(viewers: float, hz: float) -> float:
    """Cores kept busy by the fan-out."""
    return viewers * hz * CPU_US_PER_MESSAGE / 1e6


def compute_socket_gb_per_h(viewers: float, hz: float) -> float:
    """Egress, in GB an hour."""
    return viewers * compute_socket_bytes_per_s(hz) * 3600 / 1e9


def compute_socket_cost_per_h(viewers: float, hz: float, gb: float) -> float:
    """US$ per hour: cores, and egress at `gb` per GB."""
    return count_processes(viewers, hz) * CORE_HOUR + compute_socket_gb_per_h(viewers, hz) * gb


# ---- by the lane ------------------------------------------------------------------------


def compute_answer_bytes(segment_bytes: float) -> float:
    """One segment in transit, with headers, TLS, TCP and IP."""
    sent = segment_bytes + ANSWER_BYTES + floor(segment_bytes / TLS_RECORD_BYTES_MAX) * TLS_BYTES
    return sent + ceil(sent / TCP_PAYLOAD_BYTES) * TCP_IP_BYTES


def compute_lane_bytes_per_s(hz: int, segment_s: int, motion: str = MIXED) -> float:
    """Bytes to one viewer, including all overhead."""
    return compute_answer_bytes(SEGMENT_BYTES[motion, hz, segment_s]) / segment_s


def compute_lane_gb_per_h(viewers: float, hz: int, segment_s: int) -> float:
    """Egress of the caches, in GB an hour."""
    return viewers * compute_lane_bytes_per_s(hz, segment_s) * 3600 / 1e9


def compute_lane_requests_per_h(viewers: float, segment_s: int) -> float:
    """Requests answered by the caches."""
    return viewers * 3600 / segment_s


def compute_origin_requests_per_s(viewers: float, segment_s: int) -> float:
    """Requests that reach the relay: one per segment and cache."""
    return min(viewers, NODES) / segment_s


def compute_origin_cores(viewers: float, segment_s: int) -> float:
    """Cores of the relay kept busy by the lane."""
    return compute_origin_requests_per_s(viewers, segment_s) * ORIGIN_MS_PER_ANSWER / 1e3


def count_origin_processes(viewers: float, segment_s: int) -> int:
    """The number of relays that the caches need."""
    return ceil(compute_origin_cores(viewers, segment_s) / CORE_SHARE)


def compute_origin_gb_per_h(viewers: float, hz: int, segment_s: int) -> float:
    """Egress of the relay to the caches, in GB an hour."""
    return compute_lane_gb_per_h(min(viewers, NODES), hz, segment_s)


def count_own_caches(viewers: float, hz: int, segment_s: int) -> int:
    """Rented cache servers, limited by link and by core; if there are several, one spare is added."""
    by_line = viewers * compute_lane_bytes_per_s(hz, segment_s) * 8 / 1e9 / CACHE_GBIT_S
    by_core = viewers / segment_s * NGINX_US_PER_ANSWER / 1e6 / CORE_SHARE
    needed = ceil(max(by_line, by_core))
    return needed if needed == 1 else needed + 1


def compute_lane_cost_per_h(viewers: float, hz: int, segment_s: int, provider: Provider) -> float:
    """US$ per hour: the caches, and the relay with its traffic to them."""
    gb = compute_lane_gb_per_h(viewers, hz, segment_s)
    millions = compute_lane_requests_per_h(viewers, segment_s) / 1e6
    cost = CORE_HOUR + gb * provider.per_gb + millions * provider.per_million
    if not provider.is_own:
        return cost + compute_origin_gb_per_h(viewers, hz, segment_s) * CLOUD_GB
    caches = count_own_caches(viewers, hz, segment_s)
    return cost + caches * CORE_HOUR + compute_lane_gb_per_h(caches, hz, segment_s) * FLAT_GB


def count_retrying_viewers() -> int:
    """How many pages in the lane may try a socket on one process, which spends RETRIES_SHARE on them."""
    return int(RETRIES_SHARE * HANDSHAKES_PER_S * LANE_RETRY_S)


# ---- storms -----------------------------------------------------------------------------


def compute_deploy_share(viewers: float, hz: float) -> float:
    """One process is replaced: the peak share of the others' handshake capacity that its viewers use.

    A single process is its own successor.
    """
    count = count_processes(viewers, hz)
    moved = min(viewers, viewers / count)
    return moved / min(DRAIN_S, moved / DRAIN_PER_S) / (HANDSHAKES_PER_S * max(1, count - 1))


def compute_last_back_s(returning: float, serving: int) -> float:
    """When the last handshake is done if this many viewers return to this many processes at once."""
    return max(BACKOFF_S, returning / (serving * HANDSHAKES_PER_S))


def compute_half_dies_s(viewers: float, hz: float) -> float:
    """Half of the processes die at once (a single one has a successor): when the last viewer is back."""
    count = count_processes(viewers, hz)
    dead = ceil(count / 2)
    return compute_last_back_s(viewers * dead / count, max(1, count - dead))
