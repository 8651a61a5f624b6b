"""Writes the same bytes to many viewers, directly to their sockets."""

from __future__ import annotations

from collections.abc import Sequence

from posecast_relay.core.viewer.viewer import Viewer
from posecast_relay.runtime.io_uring import BATCH, IoUring, write_each

SLICE = BATCH  # viewers in one turn of the event loop: about 4 ms
FEW = 8  # up to this many viewers are written one by one, because a batch has a fixed cost


class FanOut:
    """Writes with io_uring if a ring is available, else with one write() per viewer."""

    def __init__(self, ring: IoUring | None) -> None:
        self._ring = ring

    def write(self, data: bytes, viewers: Sequence[Viewer]) -> list[tuple[Viewer, Exception]]:
        """Write to at most SLICE viewers. Return those for which that failed, with the error.

        If a socket does not take everything at once, its transport sends the rest later.
        """
        failed: list[tuple[Viewer, Exception]] = []
        descriptors = [viewer.outlet.descriptor for viewer in viewers]
        if -1 in descriptors:
            for viewer in viewers:
                if viewer.outlet.descriptor == -1:
                    _write(viewer, data, failed)
            viewers = [viewer for viewer in viewers if viewer.outlet.descriptor != -1]
            descriptors = [viewer.outlet.descriptor for viewer in viewers]
        batch = self._ring.write_each if self._ring is not None and len(viewers) > FEW else write_each
        for index, taken in batch(descriptors, data):  # also after an error: the transport will meet it too
            _write(viewers[index], data[max(0, taken) :], failed)
        return failed


def _write(viewer: Viewer, data: bytes, failed: list[tuple[Viewer, Exception]]) -> None:
    try:
        viewer.outlet.write(data)
    except Exception as error:
        failed.append((viewer, error))
