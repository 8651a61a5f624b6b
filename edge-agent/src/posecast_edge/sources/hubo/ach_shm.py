"""Reads a channel on this machine by polling its file in step with the writer."""

from __future__ import annotations

import threading
import time
from pathlib import Path

from posecast_edge.sources.hubo.ach_channel import AchChannel, ChannelError
from posecast_edge.sources.hubo.reconnecting import WAIT_S, PersistentReader
from posecast_edge.sources.hubo.writer_clock import Aim, WriterClock

# A channel can't wake a reader that takes no lock. So: look when the wanted frame should have been written,
# and before that save the frames that the channel is about to overwrite. If there is no frame yet, look again
# at growing intervals.
LOOK_S = (0.0004, 0.005)
FORGET = 0.99  # decay of the measured lateness per look
LATE_S = 0.015  # how long to wait for a late frame if others have arrived; then use those


def find_channel_path(name: str) -> Path:
    """The path under which libach stores the channel of this name."""
    return Path(f"/dev/shm/achshm-{name}")


class ShmReader(PersistentReader):
    """Reads one channel file."""

    def __init__(self, path: Path) -> None:
        super().__init__(str(path))
        self._path = path
        self._channel: AchChannel | None = None
        self._beat = WriterClock()
        self._holds = 1  # frames of the newest's size
        self._late_s = 0.0  # how late looks are on this machine

    def close(self) -> None:
        """Close the file."""
        super().close()
        if self._channel is not None:
            self._channel.close()
            self._channel = None

    def _open(self) -> None:
        self._channel = AchChannel(self._path)
        self._beat = WriterClock()

    def _next(self, stop: threading.Event, wanted_s: float) -> list[bytes]:
        channel = self._channel
        assert channel is not None
        now_s = time.monotonic()
        end_s = now_s + WAIT_S
        aim = self._beat.plan_look(wanted_s, end_s - LATE_S, self._holds, self._late_s)
        for keep_s in aim.keep_s:
            self._sleep(now_s, keep_s)
            if stop.is_set():
                return []
            channel.save_frames()
            now_s = time.monotonic()
        frames = self._look(channel, aim, now_s, end_s)
        if not frames and channel.is_replaced(self._path):
            raise ChannelError("the channel was created again")
        return frames

    def _look(self, channel: AchChannel, aim: Aim, now_s: float, end_s: float) -> list[bytes]:
        """The new frames once the wanted frame has arrived or is overdue, at the latest at `end_s`."""
        look_s, pause_s = aim.look_s, LOOK_S[0]
        late_s = max(look_s, now_s) + LATE_S
        frames: list[bytes] = []
        written, enough = 0, aim.frames
        too_early_s: float | None = None  # the newest look that was
        while True:
            self._sleep(now_s, min(look_s, end_s))
            before = channel.seq
            new = channel.read_new_frames()
            now_s = time.monotonic()
            if new:
                frames += new
                written += channel.seq - before if 0 < before < channel.seq else 1
                self._holds = channel.count_slots(len(new[-1]))
            if written >= enough:
                self._beat.record_look(written, now_s, 0.0 if too_early_s is None else now_s - too_early_s)
                return frames
            if frames and now_s >= late_s:
                self._beat = WriterClock()
                return frames
            if now_s >= end_s:
                return frames
            if now_s >= look_s:
                enough = min(enough, written + 1)  # the writer is delayed: one more frame is late enough
                too_early_s, look_s = now_s, now_s + pause_s
                pause_s = min(2 * pause_s, LOOK_S[1])

    def _sleep(self, now_s: float, until_s: float) -> None:
        if until_s > now_s:
            time.sleep(until_s - now_s)
            self._late_s = max(self._late_s * FORGET, time.monotonic() - until_s)
