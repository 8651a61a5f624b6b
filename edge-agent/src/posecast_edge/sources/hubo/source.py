"""Source `hubo-ach`: a Hubo 2+ or DRC-Hubo through its daemon's channel `hubo-state`.

    hubo-ach:HOST[:PORT]   from another machine, through achd (port 8076)
    hubo-ach:shm           on the robot's own computer, from shared memory; takes no lock and writes nothing
    hubo-ach:shm:PATH      from shared memory whose file has another path, for example in a container

`--profile hubo2plus` or `--profile drchubo` selects the robot, because frames don't identify it. If the
daemon's clock stops, the source counts as silent even if frames arrive.
"""

from __future__ import annotations

import logging
import re
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from posecast_edge.kit import SAY_EVERY_S, RateLimitedLog
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.base import Deliver, Source
from posecast_edge.sources.hubo.ach_shm import ShmReader, find_channel_path
from posecast_edge.sources.hubo.achd import PORT, AchdReader
from posecast_edge.sources.hubo.reconnecting import PersistentReader
from posecast_edge.sources.hubo.state import HuboDecoder, UnknownFrame

if TYPE_CHECKING:
    from posecast_edge.profile.types import Profile
    from posecast_edge.sample import Values

log = logging.getLogger("posecast_edge.hubo_ach")

CHANNEL = "hubo-state"
ADDRESS = re.compile(r"(\[[0-9a-fA-F:.]+(?:%\w+)?\]|[A-Za-z0-9._-]+)(?::(\d{1,5}))?")
STANDSTILL_S = 1.5  # robot time unchanged for this long is logged


def open_source(address: str, profile: Profile | None) -> Source:
    """Open the source. Raises SourceError when the address is invalid. If the robot is not reachable yet, the
    source waits for it."""
    if address == "shm" or address.startswith("shm:"):
        path = address.partition(":")[2]
        reader: PersistentReader = ShmReader(Path(path) if path else find_channel_path(CHANNEL))
    else:
        match = ADDRESS.fullmatch(address)
        port = int(match[2] or PORT) if match else 0
        if match is None or not 0 < port < 65536:
            example = "hubo-ach:192.168.0.5, hubo-ach:HOST:PORT or hubo-ach:shm"
            raise SourceError(f"hubo-ach: {address!r} is not an address such as {example}")
        reader = AchdReader(match[1].strip("[]"), port, CHANNEL)
    return HuboAchSource(reader, profile)


class HuboAchSource:
    """Turns the frames of a channel reader into samples."""

    def __init__(self, reader: PersistentReader, profile: Profile | None) -> None:
        self.description = f"hubo-ach {reader.name}"
        self._reader = reader
        self._decoder = HuboDecoder(profile)
        self._foreign = RateLimitedLog(log.warning, "foreign frames", SAY_EVERY_S)
        self._reported_unknown = False
        self._t_s = float("nan")
        self._moved_s = 0.0  # when robot time last changed
        self._reported_still = False

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Deliver every frame whose time is new, until `stop`."""
        self._moved_s = time.monotonic()
        wanted_s: float | None = None
        try:
            while not stop.is_set():
                samples = self.make_samples(
                    self._reader.wait_for_frames(stop, wanted_s or 0.0), time.monotonic()
                )
                for sample in samples:
                    wanted_s = deliver(sample)
        finally:
            self._reader.close()

    def make_samples(self, frames: Sequence[bytes], now_s: float) -> list[Sample]:
        """Decode frames that arrived together, oldest first. Leaves out frames that are not hubo_state, and
        frames with the same time as their predecessor."""
        found = [taken for frame in frames if (taken := self._taken(frame, now_s)) is not None]
        last = len(found) - 1
        exact = self._decoder.exact
        return [Sample(t_s, values, exact=exact, newest=i == last) for i, (t_s, values) in enumerate(found)]

    def _taken(self, frame: bytes, now_s: float) -> tuple[float, Mapping[str, Values]] | None:
        try:
            t_s, values = self._decoder.decode(frame)
        except UnknownFrame as e:
            self._foreign.add(f"{self._reader.name}: {e}", now_s)
            return None
        if not self._reported_unknown:
            self._reported_unknown = True
            if self._decoder.unknown:
                log.warning("hubo-ach has no reading for: %s", ", ".join(self._decoder.unknown))
        if t_s == self._t_s:
            if not self._reported_still and now_s - self._moved_s > STANDSTILL_S:
                self._reported_still = True
                log.warning("%s: frames arrive, but robot time stays at %.3f s", self._reader.name, t_s)
            return None
        self._t_s, self._moved_s, self._reported_still = t_s, now_s, False
        return t_s, values
