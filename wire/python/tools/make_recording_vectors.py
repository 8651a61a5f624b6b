"""Makes `wire/vectors/recordings.json`: what `recording.json` may be and what it says, and others that every
reader refuses."""

from __future__ import annotations

import json
from typing import Any

from posecast_wire.recording import (
    PastRecording,
    RecordingError,
    decode_recording,
    encode_recording,
    key_page_path,
    pack_segment,
    segment_path,
    unpack_segment,
)
from posecast_wire.segment import SegmentError
from posecast_wire.segment.envelope import ENVELOPE_BYTES_MAX

from wire.python.tools.vector_script import COMPACT, write_document, write_lists

FROM_MS = 1_795_357_260_112
SCHEMA, OTHER, MODEL = "5c" * 32, "7d" * 32, "ab" * 32
TAKE, LATER, RUN = "00f0a1b2c3d4e5f6", "f" * 16, "8f14e45fceea167a"
TEXT = '{"type":"schema","v":1,"robot":"hubo","labels":{},"fields":[]}'
FAULT = {"type": "event", "t": 1.5, "level": "fault", "source": "knee", "text": "jam", "state": "on", "n": 7}

Document = dict[str, Any]
Part = Any  # of a text: as it is, or so many times


def least(**members: object) -> Document:
    """The least that a recording may say. `members`: other ones for some."""
    return {
        "format": "posecast-recording",
        "version": 1,
        "robot": "hubo",
        "view": "public",
        "from_ms": FROM_MS,
        "to_ms": FROM_MS + 4000,
        "takes": [{"take": TAKE, "run": "0" * 16}],
        "segments": [[0, 0, 0, 4000, 0, 0, 0, 120, None, None, 0]],
    } | members


def whole(**members: object) -> Document:
    """One that has some of everything, as a writer writes it."""
    return {
        "format": "posecast-recording",
        "version": 1,
        "robot": "hubo",
        "view": "public",
        "title": "Walking, lecture 7 – 걷기",
        "author": "A. Kim",
        "licence": "CC BY 4.0",
        "from_ms": FROM_MS,
        "to_ms": FROM_MS + 600_000,
        "notes": [
            {"at_ms": FROM_MS, "text": "It stands."},
            {"at_ms": FROM_MS + 700, "text": "Now\tit\nwalks. 🤖"},
            {"at_ms": FROM_MS + 700, "text": "still"},
        ],
        "schemas": [{"sha256": SCHEMA, "text": TEXT}, {"sha256": OTHER, "text": TEXT.replace("hubo", "é")}],
        "models": [MODEL],
        "takes": [{"take": TAKE, "run": RUN}, {"take": LATER, "run": RUN}],
        "segments": [
            [0, 400, 0, 4009, 120, 4294967290, 113, 9812, 0, 0, 0],
            [1, 0, 0, 6000, 180, 48210, 48389, 12345, 1, None, 3],
            [0, 401, 4009, 0, 0, 0, 0, 64, None, 0, 0],
            [1, 4294967295, 600_000, 0, 1, 5, 5, 2097174, 0, 0, 4294967295],
        ],
        "words": [[0, 0, "online"], [1, 0, "silent"], [1, 5999, "online"], [2, 4009, "offline"]],
        "events": [[0, 0, FAULT], [0, 0, FAULT | {"n": 8, "state": "off"}], [1, 6000, {}]],
    } | members


def good() -> list[dict[str, Any]]:
    """Documents that every reader takes; those with `encode` are what a writer makes of what they say."""
    later = whole(
        version=1.0,
        from_ms=float(FROM_MS),
        licence=None,
        author="x" * 500,
        notes=[{"at_ms": FROM_MS, "text": "🤖" * 2000, "by": "somebody"}],
        takes=[{"take": LATER, "run": RUN, "more": 1}, {"take": TAKE, "run": RUN}],
        segments=[[1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, "a value of later", []]],
        words=[[0, 0, "online", 1]],
        events=[[0, 0, {"of": "later"}, None]],
        later={"deep": [[[]]]},
    )
    ends = least(
        robot="0" * 63,
        view="a-",
        from_ms=946_684_800_000,
        to_ms=4_102_444_799_999,
        segments=[[0, 0, 3_155_759_999_999, 0, 0, 0, 0, 1, None, None, 0]],
    )
    sent = [
        ("some of everything", True, written(whole())),
        ("the least that there may be", False, written(least())),
        ("what a later writer adds", False, written(later)),
        ("the ends of the ranges", False, written(ends)),
        ("of a member named twice the last", False, written(least())[:-1] + b',"view":"lab"}'),
    ]
    return [
        {"name": name, **({"encode": True} if encode else {}), "text": text.decode(), "says": shown(text)}
        for name, encode, text in sent
    ]


def bad() -> list[dict[str, Any]]:
    """Documents that every reader refuses, in the same words."""
    row = [0, 0, 0, 4000, 0, 0, 0, 120, None, None, 0]

    def with_row(at: int, value: object, **members: object) -> Document:
        return least(segments=[[*row[:at], value, *row[at + 1 :]]], **members)

    def noted(*notes: object) -> Document:
        return least(notes=[*notes])

    def of_words(*words: object) -> Document:
        return least(words=[*words])

    documents: list[object] = [
        [],
        {},
        least(format="mcap"),
        least(format=None, version=2),
        *(least(version=version) for version in (None, 0, 1.5, True, "1", 2, 9_007_199_254_740_991, 1e300)),
        {"format": "posecast-recording", "version": 3},
        *(least(robot=robot) for robot in (None, "", "Hubo", "a" * 64, "-a", "a\n")),
        least(view=1),
        *(least(title=title) for title in ("", "x" * 501, "a\nb", 7, "\x85")),
        least(author=[]),
        least(licence="\x7f"),
        *(least(from_ms=at) for at in (None, 946_684_799_999, FROM_MS + 4001, 1e300, "0")),
        *(least(to_ms=at) for at in (FROM_MS - 1, 4_102_444_800_000, FROM_MS + 0.5)),
        least(notes={}),
        noted(1),
        noted({"text": "x"}),
        noted({"at_ms": FROM_MS - 1, "text": "x"}),
        noted({"at_ms": FROM_MS + 4001, "text": "x"}),
        noted({"at_ms": FROM_MS + 1, "text": "x"}, {"at_ms": FROM_MS, "text": "y"}),
        *(noted({"at_ms": FROM_MS, "text": text}) for text in (None, "", "x" * 2001, "a\rb")),
        least(schemas=1),
        least(schemas=[{"sha256": SCHEMA, "text": ""}]),
        least(schemas=[{"sha256": SCHEMA, "text": "x"}, {"sha256": SCHEMA, "text": "y"}]),
        *(least(schemas=[{"sha256": sha256, "text": "x"}]) for sha256 in (None, "", "5C" * 32, "5c" * 31)),
        least(models=[None]),
        least(models=[MODEL, MODEL]),
        least(takes=[]),
        least(takes=[TAKE]),
        least(takes=[{"take": TAKE[1:], "run": RUN}]),
        least(takes=[{"take": TAKE, "run": RUN.upper()}]),
        least(takes=[{"take": TAKE, "run": RUN}] * 2),
        least(segments=[]),
        least(segments=None),
        least(segments="none"),
        least(segments=[row[:10]]),
        least(segments=[{}]),
        *(with_row(0, at) for at in (None, 1, -1, 0.5)),
        *(with_row(1, index) for index in (-1, 4_294_967_296)),
        *(with_row(2, at) for at in (-1, 4001)),
        *(with_row(3, duration) for duration in (-1, 4001)),
        with_row(3, 600_001, to_ms=FROM_MS + 900_000),
        with_row(4, 1),
        with_row(4, 1, schemas=[{"sha256": SCHEMA, "text": "x"}]),
        *(with_row(at, 4_294_967_296) for at in (4, 5, 6, 10)),
        *(with_row(7, size) for size in (0, 2_097_175)),
        with_row(8, 0),
        with_row(9, MODEL),
        with_row(10, False),
        least(segments=[row, row]),
        least(segments=[[*row[:2], 1, 1, *row[4:]], [*row[:2], 2, 1, *row[4:]]]),
        least(segments=[[*row[:2], 1, 1, *row[4:]], [0, 1, 0, 1, *row[4:]]]),
        of_words([0, 0]),
        of_words([1, 0, "online"]),
        of_words([0, -1, "online"]),
        of_words([0, 4001, "online"]),
        of_words([0, 0, "dead"]),
        of_words([0, 0, None]),
        of_words([0, 2, "online"], [0, 1, "online"]),
        least(events=[[0, 0, "jam"]]),
        least(events=[[0, 0, []]]),
        least(events=[[0, 2, {}], [0, 1, {}]]),
    ]
    texts = [
        "",
        "{",
        "\ufeff" + written(least()).decode(),
        written(least()).decode().replace("hubo", "\\ud800"),
        written(least()).decode()[:-1] + ',"more":' + "[" * 64 + "]" * 64 + "}",
        written(least()).decode()[:-1] + ',"more":1e400}',
        *(written(document).decode() for document in documents),
    ]
    many: list[list[Part]] = [
        [written(least()).decode()[:-1] + ',"notes":[', ["0,", 1000], "0]}"],
        [written(least()).decode()[:-1] + ',"models":[', ["0,", 1024], "0]}"],
        [written(least()).decode()[:-1] + ',"segments":[', ["0,", 200_000], "0]}"],
        [written(least()).decode()[:-1] + ',"words":[', ["0,", 400_000], "0]}"],
        [written(least()).decode()[:-1], [" ", 32 << 20], "}"],
    ]
    return [{"says": _refusal(joined(parts)), "text": parts} for parts in ([[text] for text in texts] + many)]


def joined(parts: list[Part]) -> str:
    """The text of its parts."""
    return "".join(part if isinstance(part, str) else part[0] * part[1] for part in parts)


def packed() -> list[dict[str, Any]]:
    """Files of segments, as bytes and how often, and how long what they hold is, or why there is nothing."""
    small, longest = (pack_segment(bytes(size)).hex() for size in (100, ENVELOPE_BYTES_MAX))
    bomb = pack_segment(bytes(ENVELOPE_BYTES_MAX + 1)).hex()
    made: list[list[tuple[str, int]]] = [
        [(b"\x89PCS".hex(), 1)],
        [("", 1)],
        [("1f", 1)],
        [(small, 1)],
        [(longest, 1)],
        [(bomb, 1)],
        [(small[:-2], 1)],
        [("1f8b", 1)],
        [(small[:-16] + "00" * 8, 1)],
        [("1f8b08000000000002ff", 1), ("ff", 40)],
    ]
    cases: list[dict[str, Any]] = []
    for parts in made:
        data = b"".join(bytes.fromhex(digits) * times for digits, times in parts)
        try:
            says = f"{len(unpack_segment(data))} bytes"
        except SegmentError as e:
            says = str(e)
        cases.append({"says": says, "bytes": parts})
    return cases


def written(document: object) -> bytes:
    """As a writer writes it."""
    return json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode()


def shown(data: bytes) -> dict[str, Any]:
    """What it says, as TypeScript can compare it: numbers past 2^53 as digits."""
    return shown_recording(decode_recording(data))


def shown_recording(found: PastRecording) -> dict[str, Any]:
    """Likewise."""
    return {
        "robot": found.robot,
        "view": found.view,
        "title": found.title,
        "author": found.author,
        "licence": found.licence,
        "from_ms": found.from_ms,
        "to_ms": found.to_ms,
        "notes": [[note.at_ms, note.text] for note in found.notes],
        "schemas": [[sha256, text] for sha256, text in found.schemas.items()],
        "models": [*found.models],
        "segments": [
            {
                "path": segment_path(one.take, one.index),
                "key_page": key_page_path(one.from_ms),
                "take": f"{one.take:016x}",
                "run_id": f"{one.run_id:016x}",
                "index": one.index,
                "from_ms": one.from_ms,
                "to_ms": one.to_ms,
                "frames": one.frames,
                "first_seq": one.first_seq,
                "last_seq": one.last_seq,
                "bytes": one.size,
                "schema": one.schema,
                "model": one.model,
                "missing": one.missing,
                "words": [[word.at_ms, word.word] for word in one.words],
                "events": [[event.at_ms, event.event] for event in one.events],
            }
            for one in found.segments
        ],
    }


def _refusal(text: str) -> str:
    try:
        decode_recording(text.encode())
    except RecordingError as e:
        return str(e)
    raise AssertionError(f"nothing wrong was found: {text[:400]}")


def files() -> dict[str, str]:
    """The file's name and text: one document a line."""
    taken = good()
    for case in taken:
        if "encode" in case:
            data = case["text"].encode()
            assert encode_recording(decode_recording(data)) == data, case["name"]
    lists = {"good": taken, "bad": bad(), "packed": packed()}
    return {"recordings.json": write_document(write_lists(lists, separators=COMPACT))}
