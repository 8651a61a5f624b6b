"""`posecast-relay`, broken on purpose: the fault suite must notice it.

broken_relay.py backpressure|fifo|runs run …

The product contains none of this; it is patched here, in a separate process.
"""

from __future__ import annotations

import struct
import sys
from collections import deque
from collections.abc import Callable, Iterable
from itertools import count

from posecast_relay.cli import main
from posecast_relay.core.actions import Action
from posecast_relay.core.robot import Runs
from posecast_relay.core.room import RateGroup, Room
from posecast_relay.core.stream import FrameOutcome, StoredFrame, Stream
from posecast_relay.core.viewer import Viewer
from posecast_wire import parse_header
from posecast_wire.frame import TAG_PLAIN, Header

WELL_SEQ = 60  # it breaks after this many frames
LATE_S = 5.0
PLAIN = struct.Struct("<BIHH")  # tag, base, distance, ms


def without_backpressure() -> None:
    """Keeps writing, whatever the socket and the acknowledgements say."""
    Viewer.pause = lambda _self, _now: None  # type: ignore[method-assign, assignment]
    Viewer.may_send = lambda _self, _now: True  # type: ignore[method-assign, assignment]


def fifo_instead_of_mailbox() -> None:
    """A viewer that can't receive a frame now gets it later, and all those after it, in order."""
    mailbox = Room._send_frame

    def queue(
        self: Room,
        group: RateGroup,
        viewers: Iterable[Viewer],
        frame: StoredFrame,
        now: float,
        out: list[Action],
    ) -> None:
        viewers = tuple(viewers)
        for viewer in viewers:
            waits = viewer.blocked or (now >= viewer.check_at and not viewer.may_send(now))
            if waits and viewer.frame is not frame:
                viewer.reliable_queue = [*(viewer.reliable_queue or ()), self._collect_lacking(viewer, frame)]
                self._record_given(viewer, frame)
        mailbox(self, group, viewers, frame, now, out)

    Room._send_frame = queue  # type: ignore[method-assign]


def unchecked_runs() -> None:
    """No run is ever retired: anyone who sends a KEY is believed."""
    Runs.is_retired = lambda _self, _run_id, _now: False  # type: ignore[method-assign, assignment]


def dropped_frames() -> None:
    """The robot counts as heard, but none of its data is passed on."""
    take = Stream.store_frame

    def drop(
        self: Stream, payload: bytes, header: Header, run_id: int, stamp_s: float, now: float, late_s: float
    ) -> FrameOutcome:
        if self.newest is None or self.newest.seq < WELL_SEQ:
            return take(self, payload, header, run_id, stamp_s, now, late_s)
        self.live_at, self.late_s = now, late_s
        return FrameOutcome.TAKEN

    Stream.store_frame = drop  # type: ignore[method-assign]


def an_old_pose_again() -> None:
    """The same pose forever, in frames with new numbers and times."""
    take = Stream.store_frame
    kept: list[bytes] = []
    steps = count(1)

    def repeat(
        self: Stream, payload: bytes, header: Header, run_id: int, stamp_s: float, now: float, late_s: float
    ) -> FrameOutcome:
        if self.newest is None or self.newest.seq < WELL_SEQ:
            return take(self, payload, header, run_id, stamp_s, now, late_s)
        if not kept and payload[0] != TAG_PLAIN:
            return take(self, payload, header, run_id, stamp_s, now, late_s)
        if not kept:
            kept.append(payload)
        tag, base, distance, ms = PLAIN.unpack_from(kept[0])
        step = next(steps)
        again = PLAIN.pack(tag, base, distance + step, ms + 33 * step) + kept[0][PLAIN.size :]
        return take(self, again, parse_header(again), run_id, stamp_s, now, late_s)

    Stream.store_frame = repeat  # type: ignore[method-assign]


def old_frames_as_fresh() -> None:
    """Every frame some seconds late, but counted as just sent."""
    take = Stream.store_frame
    waiting: deque[tuple[float, bytes, Header, int]] = deque()

    def take_later(
        self: Stream, payload: bytes, header: Header, run_id: int, stamp_s: float, now: float, late_s: float
    ) -> FrameOutcome:
        waiting.append((now, payload, header, run_id))
        while waiting and now - waiting[0][0] >= LATE_S:
            _, old, its_header, its_run = waiting.popleft()
            take(self, old, its_header, its_run, stamp_s, now, late_s)
        return FrameOutcome.TAKEN

    Stream.store_frame = take_later  # type: ignore[method-assign]


WAYS: dict[str, Callable[[], None]] = {
    "backpressure": without_backpressure,
    "fifo": fifo_instead_of_mailbox,
    "runs": unchecked_runs,
    "drops": dropped_frames,
    "repeats": an_old_pose_again,
    "late": old_frames_as_fresh,
}

if __name__ == "__main__":
    WAYS[sys.argv.pop(1)]()
    main()
