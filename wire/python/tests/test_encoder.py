"""When KEYs come, which base a frame names, what the order table does."""

from __future__ import annotations

import math
import random

import pytest
from posecast_wire import (
    CODE_MAX,
    MISSING,
    Decoder,
    Encoder,
    Schema,
    build_schema_text,
    frame_id,
    parse_header,
)
from posecast_wire.encoder import ORDER_STEPS, encode_golomb

ONE = Schema.parse(build_schema_text("one", {"x": ["x"]}, [{"name": "x", "labels": "x"}]))


def kinds(frames: list[bytes]) -> str:
    return "".join({0x13: "K", 0x10: "."}[f[0]] for f in frames)


def test_keys_follow_the_monotonic_clock_while_robot_time_stands() -> None:
    encoder = Encoder(ONE, key_interval_s=4.0)
    frames = [encoder.encode([i], i, 7.0, 100 + i / 10) for i in range(121)]
    assert [i for i, f in enumerate(frames) if f[0] == 0x13] == [0, 40, 80, 120]


def test_robot_time_that_races_or_stops_times_no_key() -> None:
    encoder = Encoder(ONE, key_interval_s=30.0)
    assert kinds([encoder.encode([i], i, i * 10.0, i / 30) for i in range(7)]) == "K......"


@pytest.mark.parametrize(
    ("seq", "t_s", "now_s", "force", "kind"),
    [
        (2, 10.1, 1.1, False, "."),
        (2, 10.1, 1.1, True, "K"),  # the link came up
        (2, 9.999, 1.1, False, "K"),  # robot time steps back
        (2, 10.0 + 65.535, 1.1, False, "."),
        (2, 10.0 + 65.536, 1.1, False, "K"),
        (2, 1e300, 1.1, False, "K"),
        (1 + 65535, 10.1, 1.1, False, "."),
        (1 + 65536, 10.1, 1.1, False, "K"),
        (1, 10.1, 1.1, False, "K"),  # the same seq again
        (0, 10.1, 1.1, False, "K"),
        (2, 10.1, 0.9, False, "K"),  # the clock is not monotonic: start anew
        (2, 10.1, 5.0, False, "K"),
        (2, 10.1, math.nan, False, "K"),
    ],
)
def test_what_forces_a_key(seq: int, t_s: float, now_s: float, force: bool, kind: str) -> None:
    encoder = Encoder(ONE)
    first = encoder.encode([1], 1, 10.0, 1.0)
    assert kinds([first, encoder.encode([2], seq, t_s, now_s, force)]) == "K" + kind


def test_time_steps_back_against_the_last_frame_too() -> None:
    encoder = Encoder(ONE)
    assert kinds([encoder.encode([0], i, t, 0.0) for i, t in enumerate([1.0, 2.0, 1.5, 1.6])]) == "K.K."


def test_every_frame_names_the_newest_key() -> None:
    encoder = Encoder(ONE, 0.4)
    frames = [encoder.encode([i], i, i / 10, i / 10) for i in range(9)]
    assert kinds(frames) == "K...K...K"
    first, second = frame_id(frames[0]), frame_id(frames[4])
    assert [parse_header(f).base_id for f in frames] == [None, *[first] * 3, None, *[second] * 3, None]
    assert encoder.key == frames[8]


def test_slow_fields_move_like_all_others() -> None:
    fields: list[dict[str, object]] = [
        {"name": "fast", "labels": "x"},
        {"name": "slow", "labels": "x", "slow": True},
    ]
    schema = Schema.parse(build_schema_text("r", {"x": ["x"]}, fields))
    encoder, decoder = Encoder(schema), Decoder()
    decoder.add_schema(schema.text)
    got = [decoder.decode(encoder.encode([i, i], i, i / 10, 0.0)).codes for i in range(7)]
    assert got == [(i, i) for i in range(7)]


def test_an_unchanged_robot_costs_a_nibble_a_field() -> None:
    encoder = Encoder(ONE)
    sizes = [len(encoder.encode([5], i, i / 30, 0.0)) for i in range(3)]
    assert sizes[1:] == [10, 10]


def test_order_table_is_learnt_over_eight_frames_and_outlives_a_forced_key() -> None:
    rng = random.Random(1)
    encoder = Encoder(ONE, 4.0)
    key = encoder.encode([0], 0, 0.0, 0.0)
    assert key[17:] == b"\xf3"  # nothing moved, nothing known
    for i in range(1, 60):
        encoder.encode([rng.randint(-500, 500)], i, i / 30, 0.0)
    learnt = [encoder.encode([0], 60 + i, 3.0, 0.0, force_key=True) for i in range(3)]
    assert len({f[17:] for f in learnt}) == 1
    assert learnt[0][17:] != key[17:]


def test_order_steps_are_the_formula() -> None:
    for k, step in enumerate(ORDER_STEPS, start=1):
        assert math.log2(0.69 * step) == pytest.approx(k - 0.5)


def test_golomb_codes() -> None:
    assert [encode_golomb(z, 0) for z in range(4)] == ["1", "010", "011", "00100"]
    assert [encode_golomb(z, 2) for z in (0, 3, 4)] == ["100", "111", "01000"]


@pytest.mark.parametrize(
    ("codes", "seq", "t_s"),
    [
        ([], 1, 0.0),
        ([1, 2], 1, 0.0),
        ([MISSING - 1], 1, 0.0),
        ([CODE_MAX + 1], 1, 0.0),
        ([1], -1, 0.0),
        ([1], 1 << 32, 0.0),
        ([1], 1, math.nan),
        ([1], 1, math.inf),
    ],
)
def test_what_no_frame_can_carry_is_refused_and_changes_nothing(
    codes: list[int], seq: int, t_s: float
) -> None:
    encoder, twin = Encoder(ONE), Encoder(ONE)
    for e in (encoder, twin):
        e.encode([1], 1, 0.0, 0.0)
    with pytest.raises(ValueError, match=r"codes|code past|no frame can carry"):
        encoder.encode(codes, seq, t_s, 0.1)
    assert encoder.encode([2], 2, 0.1, 0.2) == twin.encode([2], 2, 0.1, 0.2)


def test_a_key_interval_must_be_positive() -> None:
    for wrong in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match="key interval"):
            Encoder(ONE, wrong)
