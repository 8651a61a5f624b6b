"""Prometheus metrics of the past in an object store."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, Protocol

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric


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
