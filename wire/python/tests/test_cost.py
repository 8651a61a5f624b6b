"""What strangers send costs no more than in proportion to its length, whatever it is."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable

import pytest
from hypothesis import given, settings, target
from hypothesis import strategies as st
from posecast_testing import count_examples
from posecast_wire import (
    CODE_MAX,
    MISSING,
    Credential,
    Decoder,
    Echo,
    Frame,
    Schema,
    Snapshot,
    parse_viewer_message,
)
from posecast_wire.checked import loads

from wire.python.tools.hand_made import key_frame

from .cost import assert_no_faster_than_input, lines_run

Doc = dict[str, object]
MORE = "MORE"


def names(count: int) -> list[str]:
    return [f"{i:x}" for i in range(count)]


def schema_text(**members: object) -> str:
    fields = [{"name": "a", "labels": "j"}]
    doc: Doc = {
        "type": "schema",
        "v": 1,
        "robot": "r",
        "labels": {"j": ["x"]},
        "fields": fields,
        "more": MORE,
    }
    return json.dumps(doc | members, separators=(",", ":"), ensure_ascii=False)


def mapped(**parts: object) -> str:
    return schema_text(mapping=parts)


def with_more(json_text: str) -> str:
    return schema_text().replace(f'"{MORE}"', json_text)


def chain(fields: int) -> str:
    """One channel a field, each relative to the one before."""
    of_field = [
        {"name": f"f{i:x}", "labels": "j"} | ({"rel": f"f{i - 1:x}"} if i else {}) for i in range(fields)
    ]
    return schema_text(fields=of_field)


SCHEMAS: dict[str, Callable[[int], str]] = {
    "a label twice, at the end": lambda n: schema_text(labels={"j": [*names(n // 64), "0"]}),
    "many labels": lambda n: schema_text(labels={"j": names(n // 64)}),
    "too many labels": lambda n: schema_text(labels={"j": [*names(n // 8), "0"]}),
    "labels of a set with a long name": lambda n: schema_text(labels={"k" * (n // 2): names(n // 16)}),
    "many sets": lambda n: schema_text(labels={name: ["x"] for name in names(n // 16)}),
    "a long label": lambda n: schema_text(labels={"j": ["é" * (n // 2)]}),
    "a chain of fields": lambda n: chain(n // 64),
    "many bits": lambda n: schema_text(fields=[{"name": "a", "labels": "j", "bits": names(n // 8)}]),
    "many terms": lambda n: mapped(joints={"a": {"terms": [["x", 1]] * (n // 16)}}),
    "many joints": lambda n: mapped(joints={name: {"terms": []} for name in names(n // 20)}),
    "a long place": lambda n: mapped(units={"k" * 200: {name: {} for name in names(n // 16)}}),
    "a long key": lambda n: mapped(units={"k": {"k" * n: ""}}),
    "a long vector": lambda n: mapped(sensors={"a": {"kind": "imu", "xyz": [0] * (n // 4)}}),
    "depth": lambda n: with_more("[" * (n // 2) + "]" * (n // 2)),
    "many lists": lambda n: with_more("[" + "[]," * (n // 4) + "0]"),
    "many numbers": lambda n: with_more("[" + "0," * (n // 4) + "0]"),
    "one number": lambda n: with_more("7" * n),
    "one fraction": lambda n: with_more("0." + "7" * n),
    "one key again and again": lambda n: with_more("{" + '"a":0,' * (n // 8) + '"a":0}'),
    "escapes": lambda n: with_more('"' + "\\ud83e\\uddbe" * (n // 16) + '"'),
    "halves of pairs": lambda n: with_more('"' + "\\udc00" * (n // 8) + '"'),
    "backslashes": lambda n: with_more('"' + "\\\\" * (n // 4) + '"'),
    "space": lambda n: " " * n,
    "no end": lambda n: '{"a":' * (n // 8),
    "no end of a text": lambda n: '"' + "a" * n,
}


@pytest.mark.parametrize("kind", SCHEMAS)
def test_schema(kind: str) -> None:
    assert_no_faster_than_input(SCHEMAS[kind], Schema.parse, 15_000)


@pytest.mark.parametrize(
    "kind", ["depth", "many lists", "many numbers", "one key again and again", "escapes"]
)
def test_snapshot(kind: str) -> None:
    assert_no_faster_than_input(lambda n: SCHEMAS[kind](n).encode(), Snapshot.unpack, 60_000)


def test_a_snapshot_of_much_info_and_long_frames() -> None:
    def made(n: int) -> bytes:
        return Snapshot("é" * (n // 8), dict.fromkeys(names(n // 32), "é"), b"\x13" * (n // 4), None).pack()

    assert_no_faster_than_input(made, Snapshot.unpack, 60_000)


def test_what_is_too_long_is_not_even_parsed() -> None:
    with pytest.raises(ValueError, match="longer than 1048576 bytes"):
        Snapshot.unpack(b"[" * ((1 << 20) + 1))
    with pytest.raises(ValueError, match="longer than 1048576 bytes"):
        Echo.unpack(b"[" * ((1 << 20) + 1))


@pytest.mark.parametrize("kind", ["depth", "many lists", "many numbers", "one number", "escapes", "space"])
def test_echo_and_any_document(kind: str) -> None:
    assert_no_faster_than_input(lambda n: SCHEMAS[kind](n).encode(), Echo.unpack, 15_000)
    assert_no_faster_than_input(lambda n: SCHEMAS[kind](n).encode(), loads, 15_000)


@pytest.mark.parametrize(
    "of",
    [
        lambda n: b"[" * n,
        lambda n: b'{"type":"auth","token":"' + b"\\n" * (n // 2 - 16) + b'"}',
        lambda n: b'{"type":"rate","hz":' + b"9" * (n - 32) + b"}",
        lambda n: b'{"type":"rate","hz":0.' + b"9" * (n - 32) + b"}",
        lambda n: b'{"type":"ack","n":' + b"9" * (n - 32) + b"}",
        lambda n: b"[" + b"0," * (n // 2 - 2) + b"0]",
        lambda n: b"\xf0\x9f\xa6\xbe" * (n // 4),
    ],
)
def test_viewer_message(of: Callable[[int], bytes]) -> None:
    assert_no_faster_than_input(of, parse_viewer_message, 256)


@pytest.mark.parametrize(
    "of",
    [
        lambda n: "\n" * n,
        lambda n: ":" * n,
        lambda n: "posecast1:" + "R" * n,
        lambda n: f"posecast1:r:{'s' * 43}:{base64.b64encode(bytes(n * 3 // 4 - 64)).decode()}",
        lambda n: f"posecast1:r:{'s' * 43}:" + "=" * n,
    ],
)
def test_credential(of: Callable[[int], str]) -> None:
    assert_no_faster_than_input(of, Credential.parse, 1_200)


def longest_key(text: str) -> bytes:
    """A KEY of one channel a field whose codes go from end to end of the range, in 59 bits each."""
    size = Schema.parse(text).size
    codes = [CODE_MAX if i % 2 else MISSING for i in range(size)]
    residuals = [code - (codes[i - 1] if i else 0) for i, code in enumerate(codes)]
    return key_frame(text, 1, 0.0, [(0, [r]) for r in residuals], [4] * size)


def decoder_and_key(text: str) -> tuple[Decoder, bytes]:
    decoder = Decoder()
    decoder.add_schema(text)
    return decoder, longest_key(text)


def decoded(given: tuple[Decoder, bytes]) -> Frame:
    return given[0].decode(given[1])


def test_frame() -> None:
    assert_no_faster_than_input(lambda n: decoder_and_key(chain(n)), decoded, 256)


def test_values_of_every_field() -> None:
    def values(frame: Frame) -> list[list[float | None]]:
        return [frame.values(f.name) for f in frame.schema.fields]

    assert_no_faster_than_input(lambda n: decoded(decoder_and_key(chain(n))), values, 256)


def test_4096_channels_at_their_longest() -> None:
    decoder, key = decoder_and_key(chain(4096))
    frame = decoder.decode(key)
    assert frame.codes == (MISSING, CODE_MAX) * 2048
    assert 0.9 * frame.schema.key_bytes_max < len(key) <= frame.schema.key_bytes_max < 1 << 16


COUNTS = st.sampled_from([0, 1, 2, 30, 200])
LENGTHS = st.sampled_from([1, 20, 200, 2000])


def a_dict(of_name: st.SearchStrategy[object]) -> st.SearchStrategy[object]:
    """Names, many or few, short or long, that all hold the same."""
    return st.builds(
        lambda count, length, value: {name.rjust(length, "k"): value for name in names(count)},
        COUNTS,
        LENGTHS,
        of_name,
    )


@st.composite
def hostile_schemas(draw: st.DrawFn) -> str:
    """Whatever a schema may hold, each part at any size."""
    some_names = st.builds(lambda n, length: [name.rjust(length) for name in names(n)], COUNTS, LENGTHS)
    twice = st.builds(lambda found: found + found[-1:], some_names)
    labels = {"j": names(draw(COUNTS)) or ["x"], **draw(st.one_of(a_dict(some_names), a_dict(twice)))}
    rel = draw(st.sampled_from(["before", "first", "none"]))
    bits = draw(some_names) if draw(st.booleans()) else []
    fields: list[Doc] = []
    for i in range(draw(COUNTS)):
        found: Doc = {"name": f"f{i}", "labels": "j", "bits": bits}
        if i and rel != "none":
            found["rel"] = f"f{i - 1 if rel == 'before' else 0}"
        fields.append(found)
    joint = st.builds(lambda n: {"terms": [["x", 1]] * n}, COUNTS)
    mapping = {
        "joints": draw(a_dict(joint)),
        "sensors": draw(a_dict(st.just({"kind": "imu"}))),
        "thresholds": draw(a_dict(a_dict(st.just({"low": 0})))),
        "severity": draw(a_dict(a_dict(st.just("fault")))),
        "units": draw(a_dict(a_dict(st.just("mm")))),
        "translated_names": draw(a_dict(a_dict(st.just("x")))),
        "explain": draw(a_dict(a_dict(a_dict(st.just({"say": "x"}))))),
    }
    kept = {part: value for part, value in mapping.items() if draw(st.booleans())}
    return schema_text(labels=labels, fields=fields, mapping=kept, more=draw(COUNTS) * [[]])


@settings(max_examples=count_examples(40), deadline=None)
@given(hostile_schemas())
def test_no_schema_takes_many_lines_a_byte(text: str) -> None:
    lines = lines_run(Schema.parse, text)
    target(lines / len(text))
    assert lines < 5 * len(text) + 1000


@settings(max_examples=15, deadline=None)
@given(st.sampled_from([1, 7, 60, 500]), st.sampled_from([1, 7, 60]))
def test_no_frame_takes_many_lines_a_channel(fields: int, labels: int) -> None:
    text = schema_text(
        labels={"j": names(min(labels, 4096 // fields))},
        fields=[
            {"name": f"f{i}", "labels": "j"} | ({"rel": f"f{i - 1}"} if i else {}) for i in range(fields)
        ],
    )
    decoder = Decoder()
    schema = decoder.add_schema(text)
    residuals = [(0, [0] * f.size) for f in schema.fields]
    lines = lines_run(decoder.decode, key_frame(text, 1, 0.0, residuals, [4] * schema.size))
    assert lines < 40 * (schema.size + fields) + 500
