"""Executes deletions of the past in this process's memory, and logs them."""

from __future__ import annotations

import logging
import time
from datetime import UTC, datetime

from posecast_relay.core.past.deletions import Deletion, Deletions
from posecast_relay.core.past.kept_segment import KeptSegment
from posecast_relay.core.past.memory_store import MemoryPast
from posecast_relay.kit import write_count

log = logging.getLogger("posecast_relay")


class ObedientMemory:
    """Wraps memory for the recorder: deleted segments are removed.

    A segment that was being recorded when its deletion was ordered is neither kept when it closes nor passed
    on.
    """

    def __init__(self, kept: MemoryPast, deletions: Deletions) -> None:
        self._kept = kept
        self._deletions = deletions
        self._began_ms = time.time_ns() // 1_000_000
        deletions.on_added(self._delete)

    def add(self, segment: KeptSegment, now: float) -> None:
        """Keep a segment that has just closed, unless it was deleted. `now`: the core's clock."""
        if not self._deletions.cover_segment(segment):
            self._kept.add(segment, now)

    def _delete(self, deletion: Deletion) -> None:
        gone = self._kept.delete(deletion)
        is_new = deletion.at_ms >= self._began_ms  # older ones were logged by an earlier process
        level = logging.WARNING if gone or is_new else logging.INFO
        count = write_count(len(gone), "segment")
        log.log(level, "past delete: %s: deleted %s from memory", describe_deletion(deletion), count)


def describe_deletion(deletion: Deletion) -> str:
    """Describe in a few words what a deletion covers."""
    view = "all views" if deletion.view is None else f"view {deletion.view}"
    return f"{deletion.robot}, {view}, {_write(deletion.from_ms)} to {_write(deletion.to_ms)}"


def _write(unix_ms: int) -> str:
    try:
        return datetime.fromtimestamp(unix_ms / 1000, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    except (ValueError, OverflowError, OSError):  # after the year 9999
        return f"{unix_ms} ms"
