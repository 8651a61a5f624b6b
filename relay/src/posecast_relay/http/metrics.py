"""Serves Prometheus metrics on a separate port, so that they need not be public."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import NamedTuple, Protocol, runtime_checkable

from posecast_wire import Close
from prometheus_client import CollectorRegistry, start_http_server
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector

from posecast_relay.core.hub import Hub, RecordsPast
from posecast_relay.kit import BOUNDS_S, Breaker, Histogram
from posecast_relay.past.memory import MemoryPast
from posecast_relay.past.service import HeldRequests
from posecast_relay.runtime.dispatcher import Dispatcher


class ArchiveFigures(NamedTuple):
    """The state of an archive. `stored_bytes`: as far as it has been scanned. `free_bytes`, `disk_bytes`:
    None if unknown. Counters start with the process.
    """

    trouble: str | None
    written: int
    dropped: int
    expired: int
    failures: int
    waiting_bytes: int
    stored_bytes: int
    free_bytes: int | None
    disk_bytes: int | None


class ArchiveStats(Protocol):
    """An archive that can be measured, from any thread."""

    def measure(self) -> ArchiveFigures:
        """Return the archive's present state."""


def describe_archive(archive: ArchiveStats) -> Iterable[Metric]:
    """Yield the archive's metrics with their present values."""
    now = archive.measure()
    yield _gauge("posecast_archive_up", "Whether the archive's store works", 0 if now.trouble else 1)
    fates = {"written": now.written, "dropped": now.dropped, "expired": now.expired}
    yield _counter("posecast_archive_segments", "Segments for the store by result", fates, "fate")
    yield _counter("posecast_archive_failures", "Calls to the store that failed", now.failures)
    yield _gauge(
        "posecast_archive_waiting_bytes", "Memory of segments that wait to be written", now.waiting_bytes
    )
    yield _gauge("posecast_archive_bytes", "Size of the segments in the store", now.stored_bytes)
    if now.free_bytes is not None and now.disk_bytes is not None:
        yield _gauge("posecast_archive_free_bytes", "Free space on the archive's disk", now.free_bytes)
        yield _gauge("posecast_archive_disk_bytes", "Size of the archive's disk", now.disk_bytes)


EVICTIONS = (Close.HALF_OPEN, Close.NO_ACK, Close.EVENTS_FULL)


class MirrorStats(Protocol):
    """The counters of a mirror. `written`: its requests, `sent` and `failed`."""

    written: Counter[str]
    breaker: Breaker


class PastConnectionStats(Protocol):
    """The counters of the past's connection to Redis. `passed_over`: invalid entries there."""

    passed_over: int

    def find_trouble(self) -> str | None:
        """Return the present problem; None if it works."""

    def get_exchanges(self) -> tuple[Histogram, int]:
        """Return how long exchanges took, and how often the connection was lost."""


@runtime_checkable
class PastWriterStats(Protocol):
    """The counters of segments written to Redis."""

    written: int
    dropped: int


@dataclass(frozen=True, eq=False)
class RelayCollector(Collector):
    """Reads the core's counters when Prometheus asks, in the metrics server's thread.

    `dispatchers`: the live one, then the one for delayed viewers. `count_refused` returns how many publishers
    were refused so far. `measure_config` returns for each kind of configuration file whether it is valid and
    in force (1) or not (0). `find_expiries` returns when the certificates in use expire, in unix seconds, by
    the flag that names the file. `is_listening` returns whether robots can connect.
    """

    dispatchers: Sequence[Dispatcher]
    mirror: MirrorStats | None = None
    count_refused: Callable[[], int] = int
    past: MemoryPast | None = None
    connection: PastConnectionStats | None = None
    held: HeldRequests | None = None
    archive: ArchiveStats | None = None
    measure_config: Callable[[], Mapping[str, int]] = dict
    find_expiries: Callable[[], Mapping[str, float]] = dict
    is_listening: Callable[[], bool] = lambda: True

    def collect(self) -> Iterable[Metric]:
        """Yield all metrics with their present values."""
        live = self.dispatchers[0]
        hub, hubs = live.hub, [dispatcher.hub for dispatcher in self.dispatchers]
        everywhere = [robot for each in hubs for robot in list(each.robots.values())]
        rooms = [room for robot in everywhere for room in list(robot.rooms.values())]
        viewers = sum(len(each.viewers) for each in hubs)
        now = live.now()
        yield _gauge("posecast_viewers", "Viewers connected", viewers)
        yield _gauge("posecast_robots", "Robots by status", _count_statuses(live, now), "state")
        yield _counter("posecast_edge_frames", "Frames from robots by result", hub.outcomes, "fate")
        over = sum(1 for robot in list(hub.robots.values()) if robot.share.find_exceeded_limit(now))
        yield _gauge("posecast_robots_over_share", "Robots that send more than their share", over)
        faults: Counter[str] = sum((Counter(dispatcher.faults) for dispatcher in self.dispatchers), Counter())
        yield _counter("posecast_faults", "Faults of the relay's own code", faults, "error")
        yield _counter("posecast_publishers_refused", "Publishers that were refused", self.count_refused())
        yield _gauge(
            "posecast_config_up",
            "Whether the configuration files are valid and in force",
            self.measure_config(),
            "file",
        )
        yield _gauge("posecast_robots_port_up", "Whether robots can connect", int(self.is_listening()))
        delivered = sum(each.delivered for each in hubs) + sum(room.delivered for room in rooms)
        yield _counter("posecast_delivered_frames", "Frames sent to viewers", delivered)
        skipped = sum(each.skipped for each in hubs) + sum(room.skipped for room in rooms)
        yield _counter("posecast_skipped_frames", "Frames not sent to viewers that were too slow", skipped)
        shaken = live.handshakes
        yield _counter("posecast_handshakes", "Requests for a stream", shaken, "result")
        yield from _describe_endings(hubs)
        ceiling_hz = min(each.load.ceiling_hz for each in hubs)
        yield _gauge(
            "posecast_ceiling_hz", "Highest frame rate that overload allows; +Inf = no limit", ceiling_hz
        )
        yield _gauge("posecast_io_uring", "Whether frames are sent with io_uring", int(live.has_ring))
        yield _gauge("posecast_tasks", "Tasks on the event loop", live.tasks)
        yield _histogram(
            "posecast_frame_lateness_seconds", "Delay from robot to relay, above the lowest", hub.lateness
        )
        yield _histogram("posecast_fan_out_seconds", "Time to hand out received frames", live.fan_out)
        yield _histogram("posecast_loop_lag_seconds", "How late the event loop is", live.loop_lag)
        yield _gauge(
            "posecast_certificate_expiry_timestamp_seconds",
            "When the certificates for robots' connections expire",
            self.find_expiries(),
            "flag",
        )
        trouble = live.store.find_trouble()
        yield _gauge("posecast_store_up", "Whether the state store works", 0 if trouble else 1)
        exchanges = live.store.get_exchanges()
        if exchanges is not None:
            seconds, losses = exchanges
            yield _histogram(
                "posecast_store_seconds", "Exchanges with the store; they time out at 0.25", seconds
            )
            yield _counter("posecast_store_losses", "Times the store was lost", losses)
        if self.mirror is not None:
            yield from _describe_mirror(self.mirror)
        if self.past is not None:
            yield from _describe_past(self.past, hub.recorder)
        if self.connection is not None:
            yield from _describe_past_connection(self.connection)
        if self.held is not None:
            yield from _describe_held(self.held)
        if self.archive is not None:
            yield from describe_archive(self.archive)


def _describe_endings(hubs: Sequence[Hub]) -> Iterable[Metric]:
    endings: Counter[int] = sum((Counter(each.endings) for each in hubs), Counter())
    by_code = {str(int(code)): count for code, count in endings.items()}
    yield _counter("posecast_endings", "Viewers disconnected, by close code", by_code, "code")
    laned = sum(each.sent_to_lane for each in hubs)
    yield _counter("posecast_lane_viewers", "Viewers refused as full that were sent to the lane", laned)
    evicted = sum(endings[code] for code in EVICTIONS)
    yield _counter("posecast_evictions", "Viewers disconnected because they were too slow", evicted)


def _describe_mirror(mirror: MirrorStats) -> Iterable[Metric]:
    asked = {"sent": 0, "failed": 0} | mirror.written
    yield _counter("posecast_mirror_requests", "Requests to the mirror's database", asked, "result")
    left = 1 if mirror.breaker.is_open else 0
    yield _gauge("posecast_mirror_breaker_open", "Whether requests to it are paused after failures", left)


def _describe_past(past: MemoryPast, recorder: RecordsPast | None) -> Iterable[Metric]:
    yield _counter("posecast_past_segments", "Segments closed and kept", past.added)
    yield _counter(
        "posecast_past_crowded_out_segments",
        "Segments dropped early because memory was full",
        past.crowded_out,
    )
    yield _gauge("posecast_past_bytes", "Memory that the past takes", past.bytes)
    faults = 0 if recorder is None else sum(Counter(recorder.faults).values())
    yield _counter("posecast_past_faults", "Recordings that failed and were restarted", faults)


def _describe_past_connection(connection: PastConnectionStats) -> Iterable[Metric]:
    seconds, losses = connection.get_exchanges()
    up = 0 if connection.find_trouble() else 1
    yield _gauge("posecast_past_redis_up", "Whether the past can use Redis", up)
    yield _histogram(
        "posecast_past_redis_seconds", "Exchanges with Redis for the past; they time out at 0.25", seconds
    )
    yield _counter("posecast_past_redis_losses", "Times the past lost Redis", losses)
    yield _counter(
        "posecast_past_redis_passed_over",
        "Damaged entries in Redis that were ignored",
        connection.passed_over,
    )
    if isinstance(connection, PastWriterStats):
        fates = {"written": connection.written, "dropped": connection.dropped}
        yield _counter("posecast_past_redis_segments", "Segments for Redis by result", fates, "fate")


def _describe_held(held: HeldRequests) -> Iterable[Metric]:
    yield _gauge("posecast_past_held_requests", "Requests that wait for the next segment", held.count)
    yield _counter(
        "posecast_past_turned_away_requests",
        "Requests answered at once because too many are waiting",
        held.turned_away,
    )
    given = {"segment": 0, "next": 0, "not yet": 0, "none": 0} | held.answers
    yield _counter("posecast_past_segment_requests", "Requests for a segment by answer", given, "result")


def _histogram(name: str, text: str, times: Histogram) -> Metric:
    metric = HistogramMetricFamily(name, text)
    upto = [str(bound) for bound in BOUNDS_S] + ["+Inf"]
    metric.add_metric([], list(zip(upto, accumulate(times.counts), strict=True)), times.sum_s)
    return metric


def _count_statuses(dispatcher: Dispatcher, now: float) -> dict[str, int]:
    found = {"online": 0, "silent": 0, "offline": 0}
    for robot in list(dispatcher.hub.robots.values()):
        if robot.heard_at is not None:
            found[robot.compute_status(next(iter(list(robot.rooms.values())), None), now)] += 1
    return found


def _gauge(name: str, text: str, value: float | Mapping[str, float], label: str = "") -> Metric:
    return _fill(GaugeMetricFamily(name, text, labels=[label] if label else []), value)


def _counter(name: str, text: str, value: float | Mapping[str, float], label: str = "") -> Metric:
    return _fill(CounterMetricFamily(name, text, labels=[label] if label else []), value)


def _fill(metric: GaugeMetricFamily | CounterMetricFamily, value: float | Mapping[str, float]) -> Metric:
    """Add one value, or one for each value of the metric's label."""
    if isinstance(value, Mapping):
        for name, number in list(value.items()):
            metric.add_metric([name], number)
    else:
        metric.add_metric([], value)
    return metric


def start_metrics(host: str, port: int, collector: RelayCollector) -> tuple[int, Callable[[], None]]:
    """Serve metrics on `host`:`port` (0 = any free). Return the port and a function that stops serving.

    Raises OSError if the port is in use.
    """
    registry = CollectorRegistry()
    registry.register(collector)
    server, thread = start_http_server(port, host, registry)

    def stop() -> None:
        server.shutdown()
        server.server_close()
        thread.join(1.0)

    return int(server.server_port), stop
