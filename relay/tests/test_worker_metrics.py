"""Metrics of several workers: sums, the least, the first one's; no counter falls, whoever ends."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest
from posecast_relay.server.workers import metrics as worker_metrics
from posecast_relay.server.workers.metrics import JoinedCollector, serve_worker_metrics
from posecast_relay.server.workers.worker_place import find_metrics_path
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector

Samples = dict[tuple[str, str], float]


class _Figures(Collector):
    """A worker's, that a test sets."""

    def __init__(self, viewers: float, frames: float, ceiling_hz: float, endings: dict[str, float]) -> None:
        self.viewers, self.frames, self.ceiling_hz, self.endings = viewers, frames, ceiling_hz, endings

    def collect(self) -> Iterable[Metric]:
        """As `RelayCollector` yields some of them."""
        yield GaugeMetricFamily("posecast_viewers", "", self.viewers)
        yield CounterMetricFamily("posecast_delivered_frames", "", self.frames)
        yield GaugeMetricFamily("posecast_ceiling_hz", "", self.ceiling_hz)
        yield GaugeMetricFamily("posecast_past_bytes", "", 100 * self.viewers)
        endings = CounterMetricFamily("posecast_endings", "", labels=["code"])
        for code, count in self.endings.items():
            endings.add_metric([code], count)
        yield endings
        lag = HistogramMetricFamily("posecast_loop_lag_seconds", "")
        lag.add_metric([], [("0.1", self.frames), ("+Inf", self.frames + 1)], 2.0)
        yield lag


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[[int, Collector], Callable[[], None]]]:
    """Tells the metrics of a further worker; returns what ends it."""
    ends: list[Callable[[], None]] = []

    def start(number: int, figures: Collector) -> Callable[[], None]:
        ends.append(serve_worker_metrics(find_metrics_path(tmp_path, number), figures))
        return ends[-1]

    yield start
    for end in ends:
        end()


def read(joined: JoinedCollector) -> Samples:
    """By name and the one label's value."""
    return {
        (sample.name, next((v for k, v in sample.labels.items()), "")): sample.value
        for family in joined.collect()
        for sample in family.samples
    }


def test_figures_are_those_of_one_relay(
    tmp_path: Path,
    serve: Callable[[int, Collector], Callable[[], None]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(worker_metrics, "ANSWER_S", 0.2)
    missing: list[int] = []
    own = _Figures(1, 10, float("inf"), {"1000": 1})
    joined = JoinedCollector(own, tmp_path, 3, lambda: missing, lambda: 4)
    second = _Figures(2, 20, 15, {"1000": 2, "4409": 5})
    end = serve(1, second)
    serve(2, _Figures(4, 40, 30, {}))
    found = read(joined)
    assert found["posecast_viewers", ""] == 7
    assert found["posecast_delivered_frames_total", ""] == 70
    assert found["posecast_ceiling_hz", ""] == 15
    assert found["posecast_past_bytes", ""] == 100  # the first one's
    assert found["posecast_endings_total", "1000"] == 3
    assert found["posecast_endings_total", "4409"] == 5
    assert found["posecast_loop_lag_seconds_bucket", "0.1"] == 70
    assert found["posecast_loop_lag_seconds_bucket", "+Inf"] == 73
    assert found["posecast_loop_lag_seconds_sum", ""] == 6
    assert found["posecast_workers", "serving"] == 3
    assert found["posecast_worker_restarts_total", ""] == 4

    end()  # it is gone: what it counted stays, whom it had does not
    found = read(joined)
    assert found["posecast_viewers", ""] == 5
    assert found["posecast_delivered_frames_total", ""] == 70
    assert found["posecast_ceiling_hz", ""] == 30
    assert (found["posecast_workers", "serving"], found["posecast_workers", "missing"]) == (2, 1)

    serve(1, _Figures(1, 3, 60, {"1000": 1}))  # another process in its place, that begins at 0
    found = read(joined)
    assert found["posecast_delivered_frames_total", ""] == 73
    assert found["posecast_endings_total", "1000"] == 4
    assert found["posecast_endings_total", "4409"] == 5
    assert found["posecast_viewers", ""] == 6
    missing.append(2)
    assert read(joined)["posecast_workers", "missing"] == 1


def test_who_is_silent_or_talks_nonsense_holds_nobody_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker_metrics, "ANSWER_S", 0.2)
    joined = JoinedCollector(_Figures(1, 10, 60, {}), tmp_path, 2, list, int)
    with socket.socket(socket.AF_UNIX) as silent:
        silent.bind(str(find_metrics_path(tmp_path, 1)))
        silent.listen()
        assert read(joined)["posecast_workers", "missing"] == 1
