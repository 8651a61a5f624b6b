"""The same bytes to many viewers, past their transports and straight to the sockets."""

from __future__ import annotations

from collections.abc import Sequence

from posecast_relay.adapters.uring import BATCH, Ring, write_each
from posecast_relay.core.viewer import Viewer

SLICE = BATCH  # viewers in one turn of the event loop: some 4 ms
FEW = 8  # so many are written to one by one: a batch has a price of its own


class FanOut:
    """By io_uring when there is a ring, else one write() per viewer."""

    def __init__(self, ring: Ring | None) -> None:
        self._ring = ring

    def write(self, data: bytes, viewers: Sequence[Viewer]) -> None:
        """To at most SLICE viewers. What a socket does not take is its transport's to send."""
        outlets = [viewer.outlet for viewer in viewers]
        descriptors = [outlet.descriptor for outlet in outlets]
        if -1 in descriptors:
            for outlet in outlets:
                if outlet.descriptor == -1:
                    outlet.write(data)
            outlets = [outlet for outlet in outlets if outlet.descriptor != -1]
            descriptors = [outlet.descriptor for outlet in outlets]
        batch = self._ring.write_each if self._ring is not None and len(outlets) > FEW else write_each
        for index, taken in batch(descriptors, data):
            outlets[index].write(data[max(0, taken) :])  # also after an error: the transport will meet it too
