"""Frames of a channel on this machine, by looking at its file in the writer's rhythm."""

from __future__ import annotations

import threading
import time
from pathlib import Path

from posecast_edge.sources.ach_channel import Channel, ChannelError
from posecast_edge.sources.beat import Beat
from posecast_edge.sources.persistent import WAIT_S, PersistentReader

# Nobody can be woken by a channel without taking its lock. So: look when the frame that is wanted should have
# been written, and before that when the channel begins to forget what nobody has looked at; if nothing is
# there yet, look again and again, ever more seldom.
LOOK_S = (0.0004, 0.005)
LATE_S = 0.03  # so long after its time a frame is waited for when others are there; then they count


def channel_path(name: str) -> Path:
    """Where libach keeps the channel of that name."""
    return Path(f"/dev/shm/achshm-{name}")


class ShmReader(PersistentReader):
    """One channel file."""

    def __init__(self, path: Path) -> None:
        super().__init__(str(path))
        self._path = path
        self._channel: Channel | None = None
        self._beat = Beat()
        self._most = 1  # frames between two looks

    def close(self) -> None:
        """Give the file up."""
        super().close()
        if self._channel is not None:
            self._channel.close()
            self._channel = None

    def _open(self) -> None:
        self._channel = Channel(self._path)
        self._beat = Beat()

    def _next(self, stop: threading.Event, wanted_s: float) -> list[bytes]:
        channel = self._channel
        assert channel is not None
        end_s = time.monotonic() + WAIT_S
        frames: list[bytes] = []
        while not (stop.is_set() or self._look(channel, wanted_s, end_s, frames)):
            pass  # that was only lest something be lost
        if not frames and channel.replaced(self._path):
            raise ChannelError("the channel was made anew")
        return frames

    def _look(self, channel: Channel, wanted_s: float, end_s: float, frames: list[bytes]) -> bool:
        """Adds what the next look finds to `frames`, at the latest at `end_s`. True when it was for the
        wanted frame, or that does not come."""
        now_s = time.monotonic()
        aim = self._beat.aim(wanted_s, self._most)
        look_s, pause_s = aim.look_s, LOOK_S[0]
        late_s = max(look_s, now_s) + LATE_S
        written = 0
        too_early_s: float | None = None  # the newest look that was
        while True:
            if look_s > now_s:
                time.sleep(max(0.0, min(look_s, end_s) - now_s))
            before = channel.seq
            new = channel.fresh()
            now_s = time.monotonic()
            if new:
                frames += new
                written += channel.seq - before if 0 < before < channel.seq else 1
                # half of what it keeps; the other half is time to be late in
                self._most = (channel.holds(len(new[-1])) + 1) // 2
            if written >= aim.frames:
                blind_s = 0.0 if too_early_s is None else now_s - too_early_s
                self._beat.came(written, now_s, blind_s, aim.closely)
                return aim.closely or now_s >= end_s
            if frames and now_s >= late_s:
                self._beat = Beat()
                return True
            if now_s >= end_s:
                return True
            if now_s >= look_s:
                too_early_s, look_s = now_s, now_s + pause_s
                pause_s = min(2 * pause_s, LOOK_S[1])
