"""Segments of several takes become one run again."""

from __future__ import annotations

import random

from posecast_wire import Encoder
from posecast_wire.segment import SegmentWriter, decode_segment, merge_segments

from .recordings import FROM_MS, few_frames, one_channel, plain_start


def test_what_two_recorders_heard_is_merged() -> None:
    frames = few_frames(8)  # numbers from 10 on
    segments = []
    for late_us, heard in ((300, (0, 1, 2, 5)), (900, (0, 2, 3, 7))):
        writer = SegmentWriter(plain_start(from_ms=FROM_MS + late_us))
        for n in heard:
            writer.append_frame(frames[n], 1000 * n, late_us)
        segments.append(decode_segment(writer.close(FROM_MS + late_us + 8)))
    random.Random(1).shuffle(segments)
    (run,) = merge_segments(segments)
    assert run.run_id == plain_start().run_id
    assert [(each.seq, each.late_us) for each in run.frames] == [
        *[(10, 300), (11, 300), (12, 300), (13, 900), (15, 300), (17, 900)]
    ]
    assert [each.frame for each in run.frames] == [frames[n] for n in (0, 1, 2, 3, 5, 7)]
    assert run.frames[3].unix_us == 1000 * (FROM_MS + 900) + 3000
    assert run.missing == 2


def test_numbers_go_round() -> None:
    encoder = Encoder(one_channel())
    writer = SegmentWriter(plain_start())
    seqs = [(1 << 32) - 2, (1 << 32) - 1, 0, 3]
    for n, seq in enumerate(seqs):
        writer.append_frame(encoder.encode([n], seq, n / 30, n / 30), 1000 * n, 0)
    (run,) = merge_segments([decode_segment(writer.close(FROM_MS + 4))])
    assert [each.seq for each in run.frames] == seqs
    assert run.missing == 2


def test_nothing_makes_no_run() -> None:
    writer = SegmentWriter(plain_start())
    writer.append_event("{}", 0)
    assert merge_segments([decode_segment(writer.close(FROM_MS))]) == ()
    assert merge_segments([]) == ()
