"""Serves Prometheus metrics on a separate port, so that they need not be public."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import accumulate
from typing import NamedTuple, Protocol, runtime_checkable

from posecast_wire import Close
from prometheus_client import CollectorRegistry, start_http_server
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector

from posecast_relay.core.hub import Hub, RecordsPast
from posecast_relay.kit import BOUNDS_S, Breaker, Histogram
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
    yield GaugeMetricFamily(
        "posecast_archive_up", "Whether the archive's store works", 0 if now.trouble else 1
    )
    fates = CounterMetricFamily(
        "posecast_archive_segments", "Segments for the store by result", labels=["fate"]
    )
    for fate, count in (("written", now.written), ("dropped", now.dropped), ("expired", now.expired)):
        fates.add_metric([fate], count)
    yield fates
    yield CounterMetricFamily("posecast_archive_failures", "Calls to the store that failed", now.failures)
    yield GaugeMetricFamily(
        "posecast_archive_waiting_bytes", "Memory of segments that wait to be written", now.waiting_bytes
    )
    yield GaugeMetricFamily("posecast_archive_bytes", "Size of the segments in the store", now.stored_bytes)
    if now.free_bytes is not None and now.disk_bytes is not None:
        yield GaugeMetricFamily(
            "posecast_archive_free_bytes", "Free space on the archive's disk", now.free_bytes
        )
        yield GaugeMetricFamily("posecast_archive_disk_bytes", "Size of the archive's disk", now.disk_bytes)


EVICTIONS = (Close.HALF_OPEN, Close.NO_ACK, Close.EVENTS_FULL)


class MirrorStats(Protocol):
    """The counters of a mirror. `written`: its requests, `sent` and `failed`."""

    written: Counter[str]
    breaker: Breaker


class PastStats(Protocol):
    """The counters of the recorded past. `added`, `crowded_out`: segments since the process started."""

    bytes: int
    added: int
    crowded_out: int


class PastConnectionStats(Protocol):
    """The counters of the past's connection to Redis. `passed_over`: invalid entries there."""

    passed_over: int

    def find_trouble(self) -> str | None:
        """Return the present problem; None if it works."""

    def get_exchanges(self) -> tuple[Histogram, int]:
        """Return how long exchanges took, and how often the connection was lost."""


class HeldStats(Protocol):
    """The counters of requests that wait for the next segment."""

    count: int
    turned_away: int
    answers: Counter[str]


@runtime_checkable
class PastWriterStats(Protocol):
    """The counters of segments written to Redis."""

    written: int
    dropped: int


class RelayCollector(Collector):
    """Reads the core's counters when Prometheus asks, in the metrics server's thread."""

    def __init__(
        self,
        dispatchers: Sequence[Dispatcher],
        mirror: MirrorStats | None = None,
        refused: Callable[[], int] = int,
        past: PastStats | None = None,
        connection: PastConnectionStats | None = None,
        held: HeldStats | None = None,
        archive: ArchiveStats | None = None,
        measure_config: Callable[[], Mapping[str, int]] = dict,
        find_expiries: Callable[[], Mapping[str, float]] = dict,
        is_listening: Callable[[], bool] = lambda: True,
    ) -> None:
        """`dispatchers`: the live one, then the one for delayed viewers.

        `refused` returns how many publishers were refused so far. `measure_config` returns for each kind of
        configuration file whether it is valid and in force (1) or not (0). `find_expiries` returns when the
        certificates in use expire, in unix seconds, by the flag that names the file. `is_listening` returns
        whether robots can connect.
        """
        self._refused = refused
        self._dispatcher = dispatchers[0]
        self._dispatchers = list(dispatchers)
        self._hubs = [dispatcher.hub for dispatcher in dispatchers]
        self._mirror = mirror
        self._past = past
        self._connection = connection
        self._held = held
        self._archive = archive
        self._measure_config = measure_config
        self._find_expiries = find_expiries
        self._is_listening = is_listening

    def collect(self) -> Iterable[Metric]:
        """Yield all metrics with their present values."""
        hub = self._dispatcher.hub
        everywhere = [robot for each in self._hubs for robot in list(each.robots.values())]
        rooms = [room for robot in everywhere for room in list(robot.rooms.values())]
        viewers = sum(len(each.viewers) for each in self._hubs)
        now = self._dispatcher.now()
        yield GaugeMetricFamily("posecast_viewers", "Viewers connected", viewers)
        yield _make_labelled(
            "posecast_robots",
            "Robots by status",
            "state",
            _count_statuses(self._dispatcher, now),
            GaugeMetricFamily,
        )
        yield _make_labelled(
            "posecast_edge_frames",
            "Frames from robots by result",
            "fate",
            hub.outcomes,
            CounterMetricFamily,
        )
        over = sum(1 for robot in list(hub.robots.values()) if robot.share.find_exceeded_limit(now))
        yield GaugeMetricFamily("posecast_robots_over_share", "Robots that send more than their share", over)
        faults: Counter[str] = sum(
            (Counter(dispatcher.faults) for dispatcher in self._dispatchers), Counter()
        )
        yield _make_labelled(
            "posecast_faults", "Faults of the relay's own code", "error", faults, CounterMetricFamily
        )
        yield CounterMetricFamily(
            "posecast_publishers_refused", "Publishers that were refused", self._refused()
        )
        yield _make_labelled(
            "posecast_config_up",
            "Whether the configuration files are valid and in force",
            "file",
            self._measure_config(),
            GaugeMetricFamily,
        )
        yield GaugeMetricFamily(
            "posecast_robots_port_up", "Whether robots can connect", int(self._is_listening())
        )
        delivered = sum(each.delivered for each in self._hubs) + sum(room.delivered for room in rooms)
        yield CounterMetricFamily("posecast_delivered_frames", "Frames sent to viewers", delivered)
        skipped = sum(each.skipped for each in self._hubs) + sum(room.skipped for room in rooms)
        yield CounterMetricFamily(
            "posecast_skipped_frames", "Frames not sent to viewers that were too slow", skipped
        )
        shaken = self._dispatcher.handshakes
        yield _make_labelled(
            "posecast_handshakes", "Requests for a stream", "result", shaken, CounterMetricFamily
        )
        yield from _describe_endings(self._hubs)
        ceiling_hz = min(each.load.ceiling_hz for each in self._hubs)
        yield GaugeMetricFamily(
            "posecast_ceiling_hz", "Highest frame rate that overload allows; +Inf = no limit", ceiling_hz
        )
        yield GaugeMetricFamily("posecast_tasks", "Tasks on the event loop", self._dispatcher.tasks)
        yield _make_histogram(
            "posecast_frame_lateness_seconds", "Delay from robot to relay, above the lowest", hub.lateness
        )
        yield _make_histogram(
            "posecast_fan_out_seconds", "Time to hand out received frames", self._dispatcher.fan_out
        )
        yield _make_histogram(
            "posecast_loop_lag_seconds", "How late the event loop is", self._dispatcher.loop_lag
        )
        yield _make_labelled(
            "posecast_certificate_expiry_timestamp_seconds",
            "When the certificates for robots' connections expire",
            "flag",
            self._find_expiries(),
            GaugeMetricFamily,
        )
        trouble = self._dispatcher.store.find_trouble()
        yield GaugeMetricFamily("posecast_store_up", "Whether the state store works", 0 if trouble else 1)
        exchanges = self._dispatcher.store.get_exchanges()
        if exchanges is not None:
            seconds, losses = exchanges
            yield _make_histogram(
                "posecast_store_seconds", "Exchanges with the store; they time out at 0.25", seconds
            )
            yield CounterMetricFamily("posecast_store_losses", "Times the store was lost", losses)
        if self._mirror is not None:
            yield from _describe_mirror(self._mirror)
        if self._past is not None:
            yield from _describe_past(self._past, hub.recorder)
        if self._connection is not None:
            yield from _describe_past_connection(self._connection)
        if self._held is not None:
            yield from _describe_held(self._held)
        if self._archive is not None:
            yield from describe_archive(self._archive)


def _describe_endings(hubs: Sequence[Hub]) -> Iterable[Metric]:
    endings: Counter[int] = sum((Counter(each.endings) for each in hubs), Counter())
    by_code = {str(int(code)): count for code, count in endings.items()}
    yield _make_labelled(
        "posecast_endings", "Viewers disconnected, by close code", "code", by_code, CounterMetricFamily
    )
    laned = sum(each.sent_to_lane for each in hubs)
    yield CounterMetricFamily(
        "posecast_lane_viewers", "Viewers refused as full that were sent to the lane", laned
    )
    evicted = sum(endings[code] for code in EVICTIONS)
    yield CounterMetricFamily(
        "posecast_evictions", "Viewers disconnected because they were too slow", evicted
    )


def _describe_mirror(mirror: MirrorStats) -> Iterable[Metric]:
    asked = {"sent": 0, "failed": 0} | mirror.written
    text = "Requests to the mirror's database"
    yield _make_labelled("posecast_mirror_requests", text, "result", asked, CounterMetricFamily)
    left = 1 if mirror.breaker.is_open else 0
    yield GaugeMetricFamily(
        "posecast_mirror_breaker_open", "Whether requests to it are paused after failures", left
    )


def _describe_past(past: PastStats, recorder: RecordsPast | None) -> Iterable[Metric]:
    yield CounterMetricFamily("posecast_past_segments", "Segments closed and kept", past.added)
    yield CounterMetricFamily(
        "posecast_past_crowded_out_segments",
        "Segments dropped early because memory was full",
        past.crowded_out,
    )
    yield GaugeMetricFamily("posecast_past_bytes", "Memory that the past takes", past.bytes)
    faults = 0 if recorder is None else sum(Counter(recorder.faults).values())
    yield CounterMetricFamily("posecast_past_faults", "Recordings that failed and were restarted", faults)


def _describe_past_connection(connection: PastConnectionStats) -> Iterable[Metric]:
    seconds, losses = connection.get_exchanges()
    up = 0 if connection.find_trouble() else 1
    yield GaugeMetricFamily("posecast_past_redis_up", "Whether the past can use Redis", up)
    yield _make_histogram(
        "posecast_past_redis_seconds", "Exchanges with Redis for the past; they time out at 0.25", seconds
    )
    yield CounterMetricFamily("posecast_past_redis_losses", "Times the past lost Redis", losses)
    yield CounterMetricFamily(
        "posecast_past_redis_passed_over",
        "Damaged entries in Redis that were ignored",
        connection.passed_over,
    )
    if isinstance(connection, PastWriterStats):
        fates = {"written": connection.written, "dropped": connection.dropped}
        text = "Segments for Redis by result"
        yield _make_labelled("posecast_past_redis_segments", text, "fate", fates, CounterMetricFamily)


def _describe_held(held: HeldStats) -> Iterable[Metric]:
    text = "Requests that wait for the next segment"
    yield GaugeMetricFamily("posecast_past_held_requests", text, held.count)
    text = "Requests answered at once because too many are waiting"
    yield CounterMetricFamily("posecast_past_turned_away_requests", text, held.turned_away)
    given = {"segment": 0, "next": 0, "not yet": 0, "none": 0} | held.answers
    text = "Requests for a segment by answer"
    yield _make_labelled("posecast_past_segment_requests", text, "result", given, CounterMetricFamily)


def _make_histogram(name: str, text: str, times: Histogram) -> Metric:
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


def _make_labelled(
    name: str,
    text: str,
    label: str,
    values: Mapping[str, float],
    family: type[CounterMetricFamily] | type[GaugeMetricFamily],
) -> Metric:
    metric = family(name, text, labels=[label])
    for value, count in list(values.items()):
        metric.add_metric([value], count)
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
