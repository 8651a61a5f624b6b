"""Joins the metrics of all workers into one relay's metrics, which the first worker serves.

A further worker serves its metrics on its socket, in Prometheus's text format. A family in SUMMED is the sum
over all workers; one in LEAST is their minimum. Every other family comes from the first worker, because only
it hears robots and stores data. A worker that does not answer within ANSWER_S counts as missing. The last
known counters of missing and ended workers still count, so that no counter ever falls."""

from __future__ import annotations

import contextlib
import os
import selectors
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.parser import text_string_to_metric_families
from prometheus_client.registry import Collector

from posecast_relay.server.workers.worker_place import find_metrics_path

ANSWER_S = 1.0
TEXT_BYTES_MAX = 1 << 20
READ_BYTES = 1 << 16
SUMMED = frozenset(
    "posecast_" + name
    for name in (
        *("viewers", "faults", "delivered_frames", "skipped_frames", "handshakes"),
        *("endings", "lane_viewers", "evictions", "tasks"),
        *("fan_out_seconds", "loop_lag_seconds"),
    )
)
LEAST = frozenset(("posecast_ceiling_hz",))
LASTING = ("counter", "histogram")  # types whose values never fall

Key = tuple[str, tuple[tuple[str, str], ...]]  # a sample's name and labels


def serve_worker_metrics(path: Path, collector: Collector) -> Callable[[], None]:
    """Serve a further worker's metrics on the socket `path`. Return a function to stop it. Raises OSError."""
    registry = CollectorRegistry()
    registry.register(collector)
    listener = socket.socket(socket.AF_UNIX)
    path.unlink(missing_ok=True)  # left by a process that was killed
    listener.bind(str(path))
    listener.listen()
    name = f"# {os.getpid()} {time.monotonic_ns()}\n".encode()

    def serve() -> None:
        while True:
            try:
                asker, _ = listener.accept()
            except OSError:
                return
            with asker, contextlib.suppress(OSError):
                asker.settimeout(ANSWER_S)
                asker.sendall(name + generate_latest(registry))

    threading.Thread(target=serve, name="metrics", daemon=True).start()

    def stop() -> None:
        with contextlib.suppress(OSError):
            listener.shutdown(socket.SHUT_RDWR)
        listener.close()

    return stop


class _Told:
    """A worker's last metrics."""

    def __init__(self, process: str, samples: Mapping[str, Mapping[Key, float]]) -> None:
        self.process = process  # which of the processes that had its number
        self.samples = samples  # by family


class JoinedCollector(Collector):
    """Collects the metrics of all workers. `missing` lists the numbers of those that don't serve."""

    def __init__(
        self,
        own: Collector,
        folder: Path,
        workers: int,
        missing: Callable[[], list[int]],
        restarts: Callable[[], int],
    ) -> None:
        self._own = own
        self._paths = {number: find_metrics_path(folder, number) for number in range(1, workers)}
        self._missing = missing
        self._restarts = restarts
        self._told: dict[int, _Told] = {}
        self._ended: dict[str, Counter[Key]] = {}  # by family: what workers that have ended had counted
        self._one_at_a_time = threading.Lock()

    def collect(self) -> Iterable[Metric]:
        """Yield the relay's metrics, and how many workers there are."""
        with self._one_at_a_time:
            texts = _ask_all(self._paths)
            for number, text in texts.items():
                self._take(number, text)
            silent = (self._paths.keys() - texts.keys()) | set(self._missing())
            for family in self._own.collect():
                yield self._join(family, texts.keys())
        yield CounterMetricFamily(
            "posecast_worker_restarts", "Times that a worker was restarted", self._restarts()
        )
        states = GaugeMetricFamily("posecast_workers", "Workers of this relay", labels=["state"])
        states.add_metric(["serving"], 1 + len(self._paths) - len(silent))
        states.add_metric(["missing"], len(silent))
        yield states

    def _take(self, number: int, text: str) -> None:
        process, _, rest = text.partition("\n")
        found: dict[str, dict[Key, float]] = {}
        for family in text_string_to_metric_families(rest):
            if family.name in SUMMED | LEAST:
                found[family.name] = {_key(s.name, s.labels): s.value for s in family.samples}
        before = self._told.get(number)
        if before is not None and before.process != process:
            for name, samples in before.samples.items():
                self._ended.setdefault(name, Counter()).update(samples)
        self._told[number] = _Told(process, found)

    def _join(self, family: Metric, answering: Iterable[int]) -> Metric:
        if family.name not in SUMMED | LEAST:
            return family
        values: dict[Key, float] = {_key(s.name, s.labels): s.value for s in family.samples}
        lasts = family.type in LASTING
        told = [self._told[n].samples for n in (self._told if lasts else answering)]
        parts = [each.get(family.name, {}) for each in told]
        if lasts:
            parts.append(self._ended.get(family.name, {}))
        for part in parts:
            for key, value in part.items():
                if family.name in LEAST:
                    values[key] = min(values.get(key, value), value)
                else:
                    values[key] = values.get(key, 0.0) + value
        joined = Metric(family.name, family.documentation, family.type)
        for (name, labels), value in values.items():
            joined.add_sample(name, dict(labels), value)
        return joined


def _key(name: str, labels: Mapping[str, str]) -> Key:
    return name, tuple(sorted(labels.items()))


def _ask_all(paths: Mapping[int, Path]) -> dict[int, str]:
    """Return the metrics of each worker that sends all of them within ANSWER_S."""
    until_s, said, whole = time.monotonic() + ANSWER_S, dict[int, bytes](), dict[int, str]()
    with contextlib.ExitStack() as opened, selectors.DefaultSelector() as waiting:
        for number, path in paths.items():
            asked = opened.enter_context(socket.socket(socket.AF_UNIX))
            asked.setblocking(False)
            with contextlib.suppress(OSError):  # it is just starting, or as many wait for it as may
                asked.connect(str(path))
                waiting.register(asked, selectors.EVENT_READ, number)
                said[number] = b""
        while waiting.get_map() and (left_s := until_s - time.monotonic()) > 0:
            for key, _ in waiting.select(left_s):
                number, data = key.data, b""
                with contextlib.suppress(OSError):
                    data = key.fileobj.recv(READ_BYTES)  # type: ignore[union-attr]
                said[number] += data
                if not data or len(said[number]) > TEXT_BYTES_MAX:
                    waiting.unregister(key.fileobj)
                    if said[number]:
                        whole[number] = said[number].decode(errors="replace")
    return whole
