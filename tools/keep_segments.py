"""Writes five segments of the demo robot to `wire/vectors/segments/`, once: every later version must read
what this version wrote, so existing files are never overwritten. `python -m tools.keep_segments`"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path

from posecast_edge.pipeline.stream import Stream
from posecast_edge.profile.reader import load_profile
from posecast_edge.sources.demo import BUNDLE, PROFILE, read_motion
from posecast_wire import Decoder
from posecast_wire.segment import SegmentStart, SegmentWriter, decode_segment

from wire.python.tools.segment_digest import make_digest

FOLDER = Path(__file__).resolve().parents[1] / "wire/vectors/segments"
FROM_MS = 1_764_000_000_000
FRAME_US = 33_333
MODEL = "4302b34d" * 8
FAULT = {"type": "event", "t": 1.2, "level": "fault", "source": "RKN", "text": "jam", "state": "on"}


def make_frames(stream: Stream, start_s: float, count: int) -> list[bytes]:
    """Frames of the demo's motion as the agent encodes them, 30 a second, the first one a KEY."""
    motion = read_motion((BUNDLE / "motion.bin").read_bytes())
    stream.force_key()
    frames: list[bytes] = []
    for i in range(count):
        now_s = start_s + i / 30
        stream.deliver(motion.make_sample(int(now_s * motion.rate_hz)), now_s)
        frame = stream.tick(now_s)
        if frame is not None:
            frames.append(frame.data)
    return frames


def begin(stream: Stream, index: int, **members: object) -> SegmentStart:
    """A header of the demo robot."""
    schema = hashlib.sha256(stream.schema.text.encode()).hexdigest()
    known = {"schema": schema, "model": MODEL, "info": stream.info, "numbering": "f3a1:2"}
    start = ("demo", "public", 0xC0FFEE0123456789, index, 0x9F00D1CE00C0DE42, FROM_MS + 4000 * index)
    return SegmentStart(*start, **(known | members))  # type: ignore[arg-type]


def event(n: int, at_ms: int, state: str = "on") -> str:
    """A numbered event, as viewers receive it."""
    return json.dumps(FAULT | {"state": state, "n": n, "at": at_ms / 1000}, separators=(",", ":"))


def make_segments() -> Iterator[tuple[str, bytes]]:
    """Names and bytes."""
    stream = Stream(load_profile(PROFILE), 4.0, print)
    walking = make_frames(stream, 21.0, 36)

    writer = SegmentWriter(begin(stream, 0))
    for i, frame in enumerate(walking[:24]):
        writer.append_frame(frame, 412 + FRAME_US * i, 137 * (i * i % 19))
    yield "key.pcs", writer.close(FROM_MS + 800)

    writer = SegmentWriter(begin(stream, 1, event_n=6), walking[0])
    writer.append_event(event(7, FROM_MS + 4003), 3_100)
    for i, frame in enumerate(walking[16:]):
        writer.append_frame(frame, 9_000 + FRAME_US * i, 700)
    writer.append_event(event(8, FROM_MS + 4700, "off"), 700_000)
    yield "copies.pcs", writer.close(FROM_MS + 4701)

    lost = begin(stream, 5, missing=3, event_n=8, word="silent", open_faults=(event(8, FROM_MS + 4700),))
    writer = SegmentWriter(lost, walking[0])
    writer.append_word("online", 0)
    for i, frame in enumerate(walking[3:30:3]):
        writer.append_frame(frame, 3 * FRAME_US * i, 480_000 - 50_000 * i)
    yield "lossy.pcs", writer.close(FROM_MS + 20_850)

    writer = SegmentWriter(begin(stream, 6, schema=None, model=None, event_n=8, info={}))
    writer.append_word("silent", 1_500_000)
    writer.append_event(event(9, FROM_MS + 25_600), 1_600_000)
    writer.append_word("offline", 3_000_000)
    yield "no_frames.pcs", writer.close(FROM_MS + 27_000)

    sitting = make_frames(stream, 50.0, 12)
    writer = SegmentWriter(begin(stream, 7, event_n=9, open_faults=(event(9, FROM_MS + 25_600),)))
    for i, frame in enumerate(sitting[:6]):
        writer.append_frame(frame, FRAME_US * i, 0)
    writer.append_info({"mode": "앉아 있음", "battery": "87 %"}, 200_000)
    writer.append_model("0d" * 32, 200_000)
    for i, frame in enumerate(make_frames(stream, 51.0, 3)):
        writer.append_frame(frame, 1_000_000 + FRAME_US * i, 250)
    writer.append_event(event(10, FROM_MS + 29_200), 1_200_000)
    writer.append_word("silent", 2_600_000)
    yield "changes.pcs", writer.close(FROM_MS + 30_600)

    yield "schema.json", stream.schema.text.encode()


def main() -> int:
    """Write the segments, unless they exist."""
    if FOLDER.exists():
        print(f"{FOLDER} exists and is never overwritten")
        return 1
    made = dict(make_segments())
    FOLDER.mkdir()
    digests: dict[str, dict[str, str]] = {}
    for name, data in made.items():
        (FOLDER / name).write_bytes(data)
        if name != "schema.json":
            decoder = Decoder()
            decoder.add_schema(made["schema.json"].decode())
            holds = make_digest(decode_segment(data), decoder)
            digests[name] = {"bytes": hashlib.sha256(data).hexdigest(), "holds": holds}
            print(f"{name}: {len(data)} bytes")
    (FOLDER / "digests.json").write_text(json.dumps(digests, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
