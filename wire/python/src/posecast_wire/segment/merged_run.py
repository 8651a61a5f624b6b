"""Puts segments together again: of each run every frame once, in order, from whichever takes have it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from posecast_wire.segment.frame_chain import SEQS
from posecast_wire.segment.records import Segment


class MergedFrame(NamedTuple):
    """A frame of a run. `unix_us`: when it was accepted, µs since 1970; `late_us`: its lateness then, µs."""

    unix_us: int
    late_us: int
    seq: int
    frame: bytes


@dataclass(frozen=True)
class MergedRun:
    """The frames of one run, each once, in the order of their numbers."""

    run_id: int
    frames: tuple[MergedFrame, ...]

    @property
    def missing(self) -> int:
        """How many frames are missing between the first and the last one."""
        if not self.frames:
            return 0
        return (self.frames[-1].seq - self.frames[0].seq) % SEQS + 1 - len(self.frames)


def merge_segments(segments: Iterable[Segment]) -> tuple[MergedRun, ...]:
    """Merge the frames of segments of one robot and view by run and number; runs in the order of their
    beginning. What several segments have is taken from the one that begins first."""
    runs: dict[int, dict[int, MergedFrame]] = {}
    for segment in sorted(segments, key=lambda each: each.start.from_ms):
        if not segment.frames:
            continue
        found = runs.setdefault(segment.start.run_id, {})
        for record in segment.frames:
            unix_us = 1000 * segment.start.from_ms + record.at_us
            found.setdefault(record.seq, MergedFrame(unix_us, record.late_us, record.seq, record.frame))
    return tuple(MergedRun(run_id, _sort_frames(list(found.values()))) for run_id, found in runs.items())


def _sort_frames(frames: list[MergedFrame]) -> tuple[MergedFrame, ...]:
    """In the order of their numbers, which go round: a run lasts for less than half a round."""
    middle = frames[0].seq - SEQS // 2
    return tuple(sorted(frames, key=lambda frame: (frame.seq - middle) % SEQS))
