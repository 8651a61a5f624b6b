"""Properties of the codec, and what a decoder keeps and forgets."""

from __future__ import annotations

import random
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posecast_wire import (
    CODE_MAX,
    MISSING,
    BadFrame,
    BaseUnknown,
    Decoder,
    Encoder,
    FrameError,
    Schema,
    build_schema_text,
    frame_id,
    parse_header,
)

from .streams import SLOW, streams

Stream = tuple[Schema, list[list[int]]]


def decoder_of(*schemas: Schema) -> Decoder:
    decoder = Decoder()
    for schema in schemas:
        decoder.add_schema(schema.text)
    return decoder


def one_channel(robot: str = "one") -> Schema:
    return Schema.parse(build_schema_text(robot, {"x": ["x"]}, [{"name": "x", "labels": "x"}]))


@SLOW
@given(streams())
def test_decode_after_encode_is_identity(stream: Stream) -> None:
    schema, states = stream
    encoder, decoder = Encoder(schema, 4.0), decoder_of(schema)
    for i, codes in enumerate(states):
        got = decoder.decode(encoder.encode(codes, i, i / 10, i / 10))
        assert list(got.codes) == codes
        assert (got.schema, got.seq) == (decoder.add_schema(schema.text), i)
        assert got.t_s == pytest.approx(i / 10, abs=0.001)


@SLOW
@given(streams(), st.data())
def test_any_subset_with_its_bases_decodes(stream: Stream, data: st.DataObject) -> None:
    schema, states = stream
    encoder = Encoder(schema, 1.0)
    frames = [encoder.encode(codes, i, i / 10, i / 10) for i, codes in enumerate(states)]
    delivered = data.draw(st.lists(st.booleans(), min_size=len(frames), max_size=len(frames)))
    decoder = decoder_of(schema)
    for frame, codes, lucky in zip(frames, states, delivered, strict=True):
        if lucky or parse_header(frame).is_key:
            assert list(decoder.decode(frame).codes) == codes


@SLOW
@given(streams(), st.data())
def test_without_its_base_a_frame_is_unknown_never_wrong(stream: Stream, data: st.DataObject) -> None:
    schema, states = stream
    encoder, decoder = Encoder(schema, 0.3), decoder_of(schema)
    for i, codes in enumerate(states):
        frame = encoder.encode(codes, i, i / 10, i / 10)
        if data.draw(st.booleans()):
            try:
                assert list(decoder.decode(frame).codes) == codes
            except BaseUnknown:
                assert not parse_header(frame).is_key


@SLOW
@given(streams(), st.data())
def test_damage_is_refused_or_read_and_a_refusal_changes_nothing(stream: Stream, data: st.DataObject) -> None:
    schema, states = stream
    encoder, decoder = Encoder(schema), decoder_of(schema)
    decoder.decode(encoder.encode(states[0], 1, 0.0, 0.0))
    plain = encoder.encode(states[-1], 2, 0.0, 0.0)
    for _ in range(4):
        hurt = bytearray(data.draw(st.one_of(st.binary(max_size=80), st.just(plain))))
        hurt = hurt[: data.draw(st.integers(0, len(hurt)))]
        if len(hurt) > 5 and data.draw(st.booleans()):
            hurt[data.draw(st.integers(5, len(hurt) - 1))] ^= 1 << data.draw(st.integers(0, 7))
        try:
            decoder.decode(bytes(hurt))
        except FrameError:
            assert list(decoder.decode(plain).codes) == states[-1]


def test_thousands_of_damaged_frames_never_crash() -> None:
    rng = random.Random(7)
    labels = {"j": [f"j{i}" for i in range(40)]}
    fields: list[dict[str, object]] = [{"name": "a", "labels": "j"}, {"name": "b", "labels": "j", "rel": "a"}]
    schema = Schema.parse(build_schema_text("r", labels, fields))
    encoder, decoder = Encoder(schema, 0.5), decoder_of(schema)
    refused = 0
    for i in range(5_000):
        codes = [rng.randint(-30, 30) for _ in range(schema.size)]
        hurt = bytearray(encoder.encode(codes, i, i / 30, i / 30))
        hurt[rng.randrange(len(hurt))] ^= 1 << rng.randrange(8)
        try:
            got = decoder.decode(bytes(hurt[: rng.randint(1, len(hurt))] if i % 2 else hurt))
        except FrameError:
            refused += 1
        else:
            assert all(MISSING <= c <= CODE_MAX for c in got.codes)
    assert refused > 2_500


def test_the_same_key_again_changes_nothing_and_a_new_one_retires_it() -> None:
    schema = one_channel()
    encoder, decoder = Encoder(schema), decoder_of(schema)
    key, plain = [encoder.encode([i], i, i / 10, 0.0) for i in range(2)]
    for frame in (key, key, plain):
        last = decoder.decode(frame)
    assert last.codes == (1,)
    decoder.decode(encoder.encode([9], 4, 0.4, 0.0, force_key=True))
    with pytest.raises(BaseUnknown):
        decoder.decode(plain)


def test_a_ref_is_refused_by_its_name_and_is_no_base() -> None:
    schema = one_channel()
    encoder, decoder = Encoder(schema), decoder_of(schema)
    key, plain = [encoder.encode([i], i, i / 10, 0.0) for i in range(2)]
    decoder.decode(key)
    ref = b"\x12" + plain[1:]
    with pytest.raises(BadFrame, match=r"^REF frames are reserved$"):
        decoder.decode(ref)
    with pytest.raises(BaseUnknown):
        decoder.decode(plain[:1] + frame_id(ref).to_bytes(4, "little") + plain[5:])
    assert decoder.decode(plain).codes == (1,)


def test_a_fifth_schema_pushes_out_the_oldest_and_the_base_in_use_stays() -> None:
    schemas = [one_channel(f"r{i}") for i in range(5)]
    encoder, decoder = Encoder(schemas[0]), decoder_of(*schemas[:4])
    key = encoder.encode([1], 1, 0.0, 0.0)
    decoder.decode(key)
    decoder.add_schema(schemas[4].text)
    with pytest.raises(BaseUnknown):
        decoder.decode(key)
    assert decoder.decode(encoder.encode([2], 2, 0.0, 0.0)).codes == (2,)


def test_values_by_field() -> None:
    labels = {"j": ["a", "b"]}
    fields: list[dict[str, object]] = [
        {"name": "pos", "labels": "j", "scale": 0.5, "unit": "rad"},
        {"name": "flags", "labels": "j", "bits": ["homed", "jam"]},
    ]
    schema = Schema.parse(build_schema_text("r", labels, fields))
    frame = decoder_of(schema).decode(Encoder(schema).encode([3, MISSING, 2, MISSING], 1, 0.0, 0.0))
    assert frame.values("pos") == [1.5, None]
    flags = schema.find_field("flags")
    assert flags is not None
    assert [flags.bits_set(c) for c in frame.codes[2:]] == [["jam"], []]
    assert flags.bits_set(1 << 27) == ["bit 27"]
    with pytest.raises(KeyError):
        frame.values("cur")


def test_a_frame_longer_than_its_schema_can_fill_is_bad_before_its_body_is_read() -> None:
    schema = one_channel()
    decoder = decoder_of(schema)
    key = Encoder(schema).encode([1], 1, 0.0, 0.0)
    with pytest.raises(BadFrame, match="frame of 27 bytes, 26 allowed by its schema"):
        decoder.decode(key[:17].ljust(27, b"\0"))
    decoder.decode(key)
    header = struct.pack("<BIHH", 0x10, frame_id(key), 1, 33)
    with pytest.raises(BadFrame, match="frame of 65536 bytes, 18 allowed by its schema"):
        decoder.decode(header.ljust(65_536, b"\0"))


def test_a_megabyte_is_refused_at_once() -> None:
    with pytest.raises(BadFrame, match="1000000 bytes"):
        Decoder().decode(b"\x10" * 1_000_000)
