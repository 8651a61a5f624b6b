"""The wire format: two implementations, which must agree."""

from __future__ import annotations

import contextlib
import struct
import zlib
from collections.abc import Callable
from typing import Any, TypeVar

from posecast_wire import (
    Ack,
    Auth,
    Credential,
    Decoder,
    Echo,
    Frame,
    FrameError,
    MessageError,
    Rate,
    Schema,
    SchemaError,
    Snapshot,
    compute_joint_values,
    frame_id,
    parse_viewer_message,
)
from posecast_wire.checked import loads
from posecast_wire.credential import SECRET
from posecast_wire.frame import TAG_KEY
from posecast_wire.key_page import decode_key_page, pick_pose
from posecast_wire.recording import (
    RecordingError,
    decode_recording,
    encode_recording,
    pack_segment,
    unpack_segment,
)
from posecast_wire.segment import SegmentError, decode_segment, encode_segment
from posecast_wire.segment.envelope import PREFIX, TAIL
from posecast_wire.segment.records import MAGIC

from fuzz.differ import agree, difference, plain
from fuzz.page_reader import ask
from fuzz.target import Differs, Refused, Target
from wire.python.tools.make_key_page_vectors import shown as shown_key_page
from wire.python.tools.make_key_page_vectors import written_again
from wire.python.tools.make_recording_vectors import shown_recording
from wire.python.tools.make_segment_vectors import shown as shown_segment

T = TypeVar("T")
FRAMES_MAX = 32  # of one case
# Bounds of Python's JSON. They hold also within a member that a later one of its name replaces: that one
# JavaScript never sees.
ALONE = ("Exceeds the limit", "nested too deeply")


def schema(data: bytes) -> None:
    """The same verdict, and the same schema."""
    text = data.decode("utf-8", "replace")
    encoded = text.encode()
    agree(lambda: Schema.parse(text), lambda: ask("schema", encoded), (SchemaError,), shown_schema, ALONE)


def mapping(data: bytes) -> None:
    """A schema, a line end, codes: the joints stand where they stand in the page."""
    head, _, tail = data.partition(b"\n")
    text = head.decode("utf-8", "replace")

    def joints() -> dict[str, dict[str, float]]:
        found = Schema.parse(text)
        codes = codes_in(tail, found.size)
        return {name: compute_joint_values(found, codes, name) for name in ("pos", "ref")}

    agree(joints, lambda: ask("mapping", text.encode() + b"\n" + tail), (SchemaError,), dict, ALONE)


def codes_in(data: bytes, size: int) -> list[int]:
    """29 bits of each 32; 0 where the bytes end."""
    whole = data[: len(data) // 4 * 4][: 4 * size]
    codes = [code >> 3 for (code,) in struct.iter_unpack("<i", whole)]
    return codes + [0] * (size - len(codes))


def frames(data: bytes) -> None:
    """A schema, a line end, and frames: both decoders say the same of each.

    Each frame stands after a byte that says whose id it gets (so that a changed KEY is found again: 1 the
    schema's or the newest KEY's, else its own) and its length in two.
    """
    head, _, tail = data.partition(b"\n")
    text = head.decode("utf-8", "replace")
    decoder = Decoder()
    try:
        schema_id = decoder.add_schema(text).id
    except SchemaError:
        return
    key_id = 0
    sent: list[bytes] = []
    said: list[Any] = []
    at = 0
    while at + 3 <= len(tail) and len(sent) < FRAMES_MAX:
        whose, size = struct.unpack_from("<BH", tail, at)
        frame = tail[at + 3 : at + 3 + size]
        at += 3 + size
        is_key = frame[:1] == bytes((TAG_KEY,))
        if len(frame) > 5 and whose == 1:
            known = schema_id if is_key else key_id
            frame = frame[:1] + known.to_bytes(4, "little") + frame[5:]
        sent.append(frame)
        try:
            said.append(shown_frame(decoder.decode(frame), frame))
        except FrameError as e:
            said.append(type(e).__name__)
            continue
        key_id = frame_id(frame) if is_key else key_id
    script = b"".join(struct.pack("<H", len(frame)) + frame for frame in sent)
    apart = difference(said, ask("frames", text.encode() + b"\n" + script), "frames")
    if apart is not None:
        raise Differs(apart)


def segment(data: bytes) -> None:
    """A segment as it is, and with checksums that fit: in both languages the same, or refused in the same
    words."""
    with contextlib.suppress(SegmentError):
        one_segment(data)
    one_segment(mended(data))


def one_segment(data: bytes) -> None:
    """What is read can be written, and is then the same; its first pose is found without reading it all."""
    found = read_alike("segment", data, decode_segment, shown_segment)
    if decode_segment(encode_segment(found)) != found:
        raise Differs("written it is another")
    if pick_pose(data) != pick_pose(found):
        raise Differs("its first pose is another")


def key_page(data: bytes) -> None:
    """A page of KEYs, likewise."""
    with contextlib.suppress(SegmentError):
        one_key_page(data)
    one_key_page(mended(data))


def one_key_page(data: bytes) -> None:
    """What is read can be written, and is then the same."""
    found = read_alike("key-page", data, decode_key_page, shown_key_page)
    if decode_key_page(written_again(found)) != found:
        raise Differs("written it is another")


def recording(data: bytes) -> None:
    """What a recording says, likewise."""
    try:
        loads(data)
    except ValueError as e:
        if any(reason in str(e) for reason in ALONE):
            raise RecordingError(str(e)) from e
    found = read_alike("recording", data, decode_recording, shown_recording)
    if decode_recording(encode_recording(found)) != found:
        raise Differs("written it is another")


def packed_segment(data: bytes) -> None:
    """The file of a segment, as it is and as what is packed. Engines differ in what may stand behind a gzip,
    and what comes of it is no segment."""
    segment = MAGIC + data
    if unpack_segment(pack_segment(segment)) != segment:
        raise Differs("packed it is another")
    read_alike("packed-segment", pack_segment(segment), unpack_segment, bytes.hex)
    with contextlib.suppress(Refused):
        ask("packed-segment", data)
    unpack_segment(data)


def read_alike(name: str, data: bytes, read: Callable[[bytes], T], shown: Callable[[T], object]) -> T:
    """What Python reads, where TypeScript reads the same. Raises SegmentError or RecordingError where both
    refuse it in the same words."""
    try:
        found = read(data)
    except (SegmentError, RecordingError) as e:
        try:
            ask(name, data)
        except Refused as there:
            if str(there) != str(e):
                raise Differs(f"Python says {str(e)!r}, TypeScript {str(there)!r}") from e
            raise e from None
        raise Differs(f"Python says {str(e)!r}, TypeScript takes it") from e
    apart = difference(shown(found), ask(name, data), name)
    if apart is not None:
        raise Differs(apart)
    return found


def mended(data: bytes) -> bytes:
    """The same with a header's length, checksums and an end that fit, as far as there is room for them."""
    around = PREFIX.size + 4 + TAIL.size
    if len(data) < around:
        return data
    size = min(int.from_bytes(data[5:9], "little"), len(data) - around)
    front = data[:5] + size.to_bytes(4, "little") + data[PREFIX.size : PREFIX.size + size]
    records = data[len(front) + 4 : -TAIL.size]
    count = TAIL.unpack(data[-TAIL.size :])[1]
    crc = zlib.crc32(front).to_bytes(4, "little")
    return front + crc + records + TAIL.pack(0, count, zlib.crc32(records))


def viewer_message(data: bytes) -> None:
    """One of four, its numbers in range; as text and as bytes the same."""
    try:
        found = parse_viewer_message(data)
    except MessageError as e:
        if not 1000 <= e.close <= 4999:
            raise Differs("no close code") from e
        raise
    if isinstance(found, Rate):
        fits = found.hz == 0 or 0.1 <= found.hz <= 1000
    elif isinstance(found, Ack):
        fits = type(found.n) is int and 0 <= found.n < 1 << 53
    else:
        fits = bool(found.token) if isinstance(found, Auth) else abs(found.t) < 1 << 53
    if not fits:
        raise Differs(f"out of range: {found}")
    if parse_viewer_message(data.decode()) != found:
        raise Differs("as text it is another")


def snapshot(data: bytes) -> None:
    """What is taken can be packed, and is then the same."""
    found = Snapshot.unpack(data)
    if Snapshot.unpack(found.pack()) != found:
        raise Differs("packed it is another")


def echo(data: bytes) -> None:
    """Likewise."""
    found = Echo.unpack(data)
    if Echo.unpack(found.pack()) != found:
        raise Differs("packed it is another")


def credential(data: bytes) -> None:
    """Likewise; the secret is never quoted."""
    text = data.decode("utf-8", "replace")
    try:
        found = Credential.parse(text)
    except ValueError as e:
        if any(SECRET.fullmatch(word) and word in str(e) for word in text.split(":")):
            raise Differs("the refusal quotes what may be the secret") from e
        raise
    if found.ca is None and Credential.parse(found.line()) != found:
        raise Differs("written it is another")


def shown_schema(found: Schema) -> dict[str, Any]:
    """As page/targets.ts shows it."""
    members = [plain(field) | {"size": field.size} for field in found.fields]
    mapping = plain(found.mapping)
    return {"id": found.id, "robot": found.robot, "fields": members, "size": found.size, "mapping": mapping}


def shown_frame(found: Frame, frame: bytes) -> list[Any]:
    """Likewise."""
    return [found.seq, found.t_s, found.codes, frame_id(frame)]


TARGETS = (
    Target("schema", schema, (SchemaError,), stretched=1 << 18, page=True),
    Target("mapping", mapping, (SchemaError,), stretched=1 << 17, page=True),
    Target("frames", frames, stretched=1 << 17, page=True),
    Target("segment", segment, (SegmentError,), stretched=1 << 18, page=True),
    Target("key-page", key_page, (SegmentError,), stretched=1 << 18, page=True),
    Target("recording", recording, (RecordingError,), stretched=1 << 18, page=True),
    Target("packed-segment", packed_segment, (SegmentError,), page=True),
    Target("viewer-message", viewer_message, (MessageError,), stretched=4096),
    Target("snapshot", snapshot, (ValueError,), stretched=1 << 18),
    Target("echo", echo, (ValueError,)),
    Target("credential", credential, (ValueError,), stretched=1 << 15),
)
