"""Random samples through the whole pure half, decoded again."""

from __future__ import annotations

import random

import pytest
from edge_stage import PROFILE
from posecast_edge.kit import NAMED_MAX
from posecast_edge.pipeline.intake import TextGuard
from posecast_edge.pipeline.stream import Stream
from posecast_edge.profile.reader import parse_profile
from posecast_edge.profile.schema import infer_profile
from posecast_edge.sample import Sample
from posecast_wire.decoder import Decoder


def stream() -> Stream:
    return Stream(parse_profile(PROFILE), 4.0, lambda line: None)


def test_what_is_decoded_is_what_was_sent_to_half_a_step() -> None:
    s = stream()
    decoder = Decoder()
    decoder.add_schema(s.schema.text)
    dice = random.Random(1)
    keys = 0
    for i in range(1000):
        now = i / 30
        pos = [dice.uniform(-3, 3), None if i % 7 == 0 else dice.uniform(-3, 3)]
        s.deliver(Sample(now, {"ref": [0.0, 0.0], "pos": pos, "flags": [i % 8, 0]}), now)
        if i == 500:
            s.force_key()
        frame = s.tick(now)
        assert frame is not None
        keys += frame.data[0] & 1
        decoded = decoder.decode(frame.data)
        assert decoded.seq == frame.seq == i
        for got, sent in zip(decoded.values("pos"), pos, strict=True):
            assert (got is None) == (sent is None)
            if got is not None and sent is not None:
                assert abs(got - sent) <= 0.0008 + 1e-9  # half a step and the deadband of 0.3 step
        assert decoded.values("flags") == [i % 8, 0]
    assert 9 <= keys <= 10  # every 4 s of 33 s, and the forced one


def test_no_snapshot_before_the_first_frame() -> None:
    s = stream()
    assert s.make_snapshot("ab", 0.0) is None
    s.deliver(Sample(0.0, {"pos": [0.0, 0.0]}, {"mode": "x"}), 0.0)
    assert s.make_snapshot(None, 0.0) is None
    frame = s.tick(0.0)
    assert frame is not None
    snapshot = s.make_snapshot(None, 0.0)
    assert snapshot is not None
    assert (snapshot.schema, snapshot.key, snapshot.info) == (s.schema.text, frame.data, {"mode": "x"})


def test_a_sample_without_a_time_is_dropped_and_said() -> None:
    said: list[str] = []
    s = Stream(parse_profile(PROFILE), 4.0, said.append)
    assert s.deliver(Sample(float("nan"), {"flags": [2, 0]}), 0.0) == []
    assert s.tick(0.0) is None
    assert said == ["a sample with time nan is dropped"]


def test_info_stays_bounded() -> None:
    said: list[str] = []
    s = Stream(parse_profile(PROFILE), 4.0, said.append)
    for i in range(200):
        s.deliver(Sample(0.0, {}, {f"k{i}": "v"}, where=f"line {i}"), 0.0)
    left_out = "is left out: at most 64 texts, 12000 bytes in all"
    assert said[:2] == [f"line 64: info 'k64' {left_out}", f"line 65: info 'k65' {left_out}"]
    assert len(said) == NAMED_MAX + 1
    s.deliver(Sample(0.0, {"pos": [0.0, 0.0]}, {"k0": "new"}), 0.0)
    s.tick(0.0)
    snapshot = s.make_snapshot(None, 0.0)
    assert snapshot is not None
    assert len(snapshot.info) == 64
    assert snapshot.info["k0"] == "new"


def test_texts_left_out_are_told_once_and_not_for_each_sample() -> None:
    said: list[str] = []
    s = Stream(parse_profile(PROFILE), 4.0, said.append)
    texts = {f"k{i}": "v" for i in range(66)}
    for second in range(10):
        s.deliver(Sample(second, {}, {**texts, "k0": str(second)}), second)
    left_out = "is left out: at most 64 texts, 12000 bytes in all"
    assert said == [f"info 'k64' {left_out}", f"info 'k65' {left_out}"]


def test_a_text_that_found_no_room_is_taken_once_there_is_some() -> None:
    s = Stream(parse_profile(PROFILE), 4.0, lambda line: None)
    s.deliver(Sample(0.0, {}, {"long": "x" * 11_000, "other": "y" * 2000}), 0.0)
    assert set(s.info) == {"long"}
    s.deliver(Sample(1.0, {}, {"long": "x", "other": "y" * 2000}), 1.0)
    assert set(s.info) == {"long", "other"}


def test_a_sample_that_is_not_the_newest_makes_events_and_no_frame() -> None:
    s = stream()
    s.deliver(Sample(0.0, {"pos": [0.0, 0.0], "flags": [0, 0]}), 0.0)
    first = s.tick(0.0)
    assert first is not None
    told = [
        (e.t_s, e.on)
        for k, mask in enumerate((2, 0), start=1)
        for e in s.deliver(Sample(k / 200, {"pos": [1.0, 1.0], "flags": [mask, 0]}, newest=False), k / 200)
    ]
    assert told == [(1 / 200, True), (2 / 200, False)]
    assert not s.fresh
    s.deliver(Sample(0.015, {"pos": [2.0, 2.0], "flags": [0, 0]}), 0.015)
    decoder = Decoder()
    decoder.add_schema(s.schema.text)
    decoder.decode(first.data)
    second = s.tick(0.033)
    assert second is not None
    assert decoder.decode(second.data).values("pos") == [2.0, 2.0]


def test_a_frame_is_as_old_as_its_sample() -> None:
    s = stream()
    s.deliver(Sample(7.0, {"pos": [0.0, 0.0]}), 100.0)
    frame = s.tick(100.4)
    assert frame is not None
    assert frame.taken_s == 100.0


def test_what_was_never_sent_is_a_picture_for_who_asks_and_no_frame() -> None:
    """The link was away when the source said its last word."""
    s = stream()
    s.deliver(Sample(1.0, {"pos": [1.0, 0.0]}), 0.0)
    first = s.tick(0.0)
    assert first is not None
    s.deliver(Sample(9.0, {"pos": [2.0, 0.0]}), 8.0)
    just = s.make_snapshot(None, 8.5)
    assert just is not None
    assert just.key == first.data, "it may be sent yet"
    assert s.tick(20.0, oldest_s=19.0) is None
    asked = [s.make_snapshot(None, 20.0), s.make_snapshot(None, 21.0)]
    assert asked[0] == asked[1], "one picture, however often it is asked for"
    assert asked[0] is not None
    decoder = Decoder()
    decoder.add_schema(s.schema.text)
    shown = decoder.decode(asked[0].key)
    assert (shown.seq, shown.t_s, shown.values("pos")[0]) == (1, 9.0, 2.0)
    s.deliver(Sample(10.0, {"pos": [3.0, 0.0]}), 22.0)
    after = s.tick(22.0, oldest_s=21.0)
    assert after is not None
    assert after.data[0] & 1, "nothing is coded against a picture"
    assert after.seq == 2
    then = s.make_snapshot(None, 30.0)
    assert then is not None
    assert then.key == after.data


def test_texts_are_bounded_in_bytes() -> None:
    said: list[str] = []
    s = Stream(parse_profile(PROFILE), 4.0, said.append)
    s.deliver(Sample(0.0, {}, {f"k{i}": "é" * 500 for i in range(20)}), 0.0)
    assert len(s.info) == 11
    s.deliver(Sample(0.0, {}, {"k0": "short"}), 10.0)
    s.deliver(Sample(0.0, {}, {"k19": "é" * 500}), 10.0)
    assert (s.info["k0"], "k19" in s.info) == ("short", True), "what became shorter makes room"


def test_after_a_fault_the_next_sample_stands_alone() -> None:
    s = stream()
    s.deliver(Sample(0.0, {"pos": [0.0, 0.0]}), 0.0)
    assert s.tick(0.0)
    s.deliver(Sample(0.1, {"pos": [1.0, 0.0]}), 0.1)
    s.recover()
    assert s.tick(0.1) is None
    s.deliver(Sample(0.2, {"pos": [1.0, 0.0]}), 0.2)
    frame = s.tick(0.2)
    assert frame is not None
    assert frame.data[0] & 1


def test_other_units_are_a_new_schema_and_the_same_run_of_frames() -> None:
    sample = Sample(0.0, {"pos": {"arm": 0.5, "finger": 0.0207}}, {"mode": "x"})
    s = Stream(infer_profile("r", sample), 4.0, lambda line: None)
    s.deliver(sample, 0.0)
    first = s.tick(0.0)
    assert first is not None
    before = s.schema
    s.change_profile(infer_profile("r", sample))
    assert s.schema is before
    s.change_profile(infer_profile("r", sample, {"finger"}))
    assert s.make_snapshot(None, 0.1) is None  # whoever asks now hears of the next frame
    s.deliver(sample._replace(t_s=0.1), 0.1)
    frame = s.tick(0.1)
    assert frame is not None
    snapshot = s.make_snapshot(None, 0.1)
    assert snapshot is not None
    assert (snapshot.schema, snapshot.key, snapshot.info) == (s.schema.text, frame.data, {"mode": "x"})
    decoder = Decoder()
    decoder.add_schema(s.schema.text)
    decoded = decoder.decode(frame.data)
    assert (first.seq, decoded.seq) == (0, 1)
    assert decoded.values("pos") == [pytest.approx(0.5), pytest.approx(0.0207)]


def test_more_channels_are_a_new_schema_and_faults_stay_told() -> None:
    first = Sample(0.0, {"pos": {"arm": 0.5}, "flags": {"arm": ["jam"]}})
    s = Stream(infer_profile("r", first), 4.0, lambda line: None)
    assert [(e.source, e.text, e.on) for e in s.deliver(first, 0.0)] == [("arm", "jam", True)]
    assert s.tick(0.0)
    more = Sample(0.1, {"pos": {"arm": 0.5, "leg": 0.25}, "flags": {"arm": ["jam"], "leg": []}})
    s.change_profile(infer_profile("r", more))
    assert s.deliver(more, 0.1) == []
    frame = s.tick(0.1)
    assert frame is not None
    decoder = Decoder()
    decoder.add_schema(s.schema.text)
    decoded = decoder.decode(frame.data)
    assert decoded.seq == 1
    assert decoded.values("pos") == [pytest.approx(0.5), pytest.approx(0.25)]
    cleared = more._replace(t_s=0.2, values={"flags": {"arm": [], "leg": ["jam"]}})
    told = [(e.source, e.text, e.on) for e in s.deliver(cleared, 0.2)]
    assert told == [("arm", "jam", False), ("leg", "jam", True)]


@pytest.mark.parametrize("exact", [False, True])
def test_a_value_that_no_code_has_is_no_reading(exact: bool) -> None:
    said: list[str] = []
    s = Stream(parse_profile(PROFILE), 4.0, said.append)
    s.deliver(Sample(0.0, {"pos": [0.5, 1e300]}, exact=exact), 0.0)
    frame = s.tick(0.0)
    assert frame is not None
    decoder = Decoder()
    decoder.add_schema(s.schema.text)
    assert decoder.decode(frame.data).values("pos") == [pytest.approx(0.5, abs=0.001), None]
    assert len(said) == 1
    assert " is 1e+300, beyond ±" in said[0]


# --- the first door for text, and that every source goes through it

HALF = "\ud800"


def guarded(sample: Sample) -> tuple[Sample, list[str]]:
    said: list[str] = []
    return TextGuard(said.append).clean(sample), said


def test_a_text_that_is_none_is_named_and_the_others_stay() -> None:
    sample, said = guarded(
        Sample(
            1.0,
            {"pos": [1.0]},
            {"mode": HALF, HALF: "x", "ok": "é😀"},
            "line 7",
            links={"imu": "torso" + HALF},
        )
    )
    assert sample == Sample(1.0, {"pos": [1.0]}, {"ok": "é😀"}, "line 7")
    assert said == [
        f"line 7: {part} is left out: it is not valid Unicode (half of a surrogate pair)"
        for part in ("info 'mode'", r"info '\ud800'", "the link of 'imu'")
    ]


def test_it_is_said_once_and_counted() -> None:
    said: list[str] = []
    guard = TextGuard(said.append)
    for i in range(600):
        guard.clean(Sample(0.0, {}, {"mode": f"{HALF}{i}"}, f"line {i}"))
    assert len(said) == 3
    assert said[2].startswith("100 more invalid names and texts, the newest: line 100: info 'mode' ")


@pytest.mark.parametrize("text", [b"bytes", 5, None])
def test_what_is_not_even_a_string(text: object) -> None:
    sample, said = guarded(Sample(0.0, {}, {"mode": text}))  # type: ignore[dict-item]
    assert (sample.info, len(said)) == ({}, 1)
