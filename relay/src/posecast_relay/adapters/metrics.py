"""Prometheus, on a port of its own: nobody who watches a robot needs to see it."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from prometheus_client import CollectorRegistry, start_http_server
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from posecast_relay.adapters.pump import Pump


class _Figures(Collector):
    """Reads the core's counters when Prometheus asks, in the metrics server's thread."""

    def __init__(self, pump: Pump) -> None:
        self._pump = pump

    def collect(self) -> Iterable[Metric]:
        """All figures, as they are now."""
        hub = self._pump.hub
        robots = list(hub.robots.values())
        rooms = [room for robot in robots for room in list(robot.rooms.values())]
        now = self._pump.now()
        yield GaugeMetricFamily("posecast_viewers", "Viewers connected", len(hub.viewers))
        yield _by(
            "posecast_robots", "Robots by liveness", "state", _words(self._pump, now), GaugeMetricFamily
        )
        yield _by(
            "posecast_edge_frames",
            "Frames from edges by what became of them",
            "fate",
            hub.fates,
            CounterMetricFamily,
        )
        delivered = sum(room.delivered for room in rooms)
        yield CounterMetricFamily("posecast_delivered_frames", "Frames handed to viewers", delivered)
        ended = {str(int(code)): count for code, count in hub.endings.items()}
        yield _by("posecast_endings", "Viewers let go, by close code", "code", ended, CounterMetricFamily)
        trouble = self._pump.store.trouble()
        yield GaugeMetricFamily("posecast_store_up", "Whether the state store works", 0 if trouble else 1)


def _words(pump: Pump, now: float) -> dict[str, int]:
    found = {"online": 0, "silent": 0, "offline": 0}
    for robot in list(pump.hub.robots.values()):
        for room in list(robot.rooms.values())[:1]:
            found[robot.word(room, now)] += 1
    return found


def _by(
    name: str,
    text: str,
    label: str,
    values: dict[str, int],
    family: type[CounterMetricFamily] | type[GaugeMetricFamily],
) -> Metric:
    metric = family(name, text, labels=[label])
    for value, count in list(values.items()):
        metric.add_metric([value], count)
    return metric


def start_metrics(host: str, port: int, pump: Pump) -> tuple[int, Callable[[], None]]:
    """Serve on `host`:`port` (0 = any free); returns the real port and how to stop. OSError when in use."""
    registry = CollectorRegistry()
    registry.register(_Figures(pump))
    server, thread = start_http_server(port, host, registry)

    def stop() -> None:
        server.shutdown()
        server.server_close()
        thread.join(1.0)

    return int(server.server_port), stop
