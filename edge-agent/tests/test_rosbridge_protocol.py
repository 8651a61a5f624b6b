"""rosbridge's messages, without a network."""

from __future__ import annotations

import json
import math
import random
import struct
from itertools import zip_longest

import cbor2
import pytest
from posecast_edge.sources.ros.rosbridge_protocol import (
    FRAGMENTS_MAX,
    MESSAGE_MAX,
    PARTS_MAX,
    Answer,
    MessageAssembler,
    Publish,
    RosbridgeProtocolError,
    RosbridgeStatus,
    make_service_call,
    make_subscribe,
)
from rosbridge_stage import fragments

MESSAGE = json.dumps({"op": "publish", "topic": "/a", "msg": {"position": [1.0, 2.0], "name": "é"}})


def test_what_is_asked_for() -> None:
    assert json.loads(make_subscribe("/a", "sensor_msgs/JointState", "cbor", 15)) == {
        "op": "subscribe",
        "id": "posecast/a",
        "topic": "/a",
        "type": "sensor_msgs/JointState",
        "throttle_rate": 15,
        "queue_length": 1,  # without it the last value before a pause would be dropped
        "compression": "cbor",
    }
    assert set(json.loads(make_subscribe("/a", None, "json", 0))) == {"op", "id", "topic"}
    assert json.loads(make_service_call("/rosapi/publishers", "p", topic="/a"))["args"] == {"topic": "/a"}


def test_what_is_heard() -> None:
    ear = MessageAssembler()
    assert ear.feed(MESSAGE) == Publish("/a", {"position": [1.0, 2.0], "name": "é"})
    answer = {"op": "service_response", "id": "topics", "values": {"topics": []}, "result": True}
    assert ear.feed(json.dumps(answer)) == Answer("topics", {"topics": []})
    assert ear.feed(json.dumps(answer | {"result": False, "values": "no"})) == Answer("topics", None)
    assert ear.feed('{"op": "status", "level": "error", "msg": "no"}') == RosbridgeStatus("error", "no")
    assert ear.feed('{"op": "advertise", "topic": "/a"}') is None


def test_nan_is_no_reading() -> None:
    heard = MessageAssembler().feed(
        '{"op": "publish", "topic": "/a", "msg": {"position": [NaN, Infinity, 1.0, null]}}'
    )
    assert heard == Publish("/a", {"position": [None, None, 1.0, None]})


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_fragments_in_any_order(size: int) -> None:
    pieces = fragments(MESSAGE, size)
    random.Random(1).shuffle(pieces)
    ear = MessageAssembler()
    heard = [ear.feed(piece) for piece in pieces]
    assert heard[:-1] == [None] * (len(pieces) - 1)
    assert heard[-1] == MessageAssembler().feed(MESSAGE)


def test_messages_in_pieces_may_mix_and_repeat_their_number() -> None:
    ear = MessageAssembler()
    one, two = fragments(MESSAGE, 20, "1"), fragments(MESSAGE, 30, 2)
    for a, b in zip_longest(one[:-1], two[:-1], fillvalue=two[-1]):
        ear.feed(a)
        ear.feed(b)
    assert isinstance(ear.feed(one[-1]), Publish)
    ear.feed(one[0])  # its rest never comes
    heard = [ear.feed(piece) for piece in one]
    assert isinstance(heard[-1], Publish)


def test_pieces_that_never_become_whole_are_given_up() -> None:
    ear = MessageAssembler()
    for k in range(PARTS_MAX + 5):
        ear.feed(fragments(MESSAGE, 20, f"k{k}")[0])
    rest = [ear.feed(piece) for piece in fragments(MESSAGE, 20, "k0")[1:]]
    assert rest == [None] * len(rest)  # its first piece is forgotten
    big = json.dumps({"op": "fragment", "id": "b", "data": "x" * (MESSAGE_MAX // 2), "num": 0, "total": 9})
    ear.feed(big)
    ear.feed(big.replace('"num": 0', '"num": 1'))
    with pytest.raises(RosbridgeProtocolError, match="fragments of more than 16 MiB"):
        ear.feed(big.replace('"num": 0', '"num": 2'))


def test_cbor_with_typed_arrays() -> None:
    arrays = {
        "u8": (64, b"\1\2", [1, 2]),
        "i8": (72, b"\xff", [-1]),
        "u16": (69, struct.pack("<2H", 1, 500), [1, 500]),
        "i32": (78, struct.pack("<i", -5), [-5]),
        "f32": (85, struct.pack("<f", 0.5), [0.5]),
        "f64": (86, struct.pack("<2d", 1.5, -2.5), [1.5, -2.5]),
        "none": (86, b"", []),
    }
    message = {name: cbor2.CBORTag(tag, data) for name, (tag, data, _) in arrays.items()}
    heard = MessageAssembler().feed(cbor2.dumps({"op": "publish", "topic": "/a", "msg": message}))
    assert heard == Publish("/a", {name: values for name, (_, _, values) in arrays.items()})
    odd = cbor2.dumps({"op": "publish", "topic": "/a", "msg": cbor2.CBORTag(86, struct.pack("<d", math.nan))})
    heard = MessageAssembler().feed(odd)
    assert isinstance(heard, Publish)
    assert math.isnan(heard.message[0])


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ("", "not JSON"),
        ("[" * 200_000, "nested too deep|not JSON"),
        ("[1, 2]", "a message without op"),
        ('{"op": 5}', "a message without op"),
        ('{"op": "publish", "msg": 1}', "a message without a topic"),
        ('{"op": "png", "data": "iVBOR"}', "PNG compression is not supported, and was not requested"),
        ('{"op": "fragment", "id": "a", "data": "x", "num": 3, "total": 2}', "an invalid fragment"),
        ('{"op": "fragment", "id": "a", "data": 5, "num": 0, "total": 2}', "an invalid fragment"),
        (
            f'{{"op": "fragment", "id": "a", "data": "x", "num": 0, "total": {FRAGMENTS_MAX + 1}}}',
            "an invalid fragment",
        ),
        ('{"op": "fragment", "id": "a", "data": "x", "num": 0, "total": 1}', "not JSON"),
        (b"", "not CBOR"),
        (b"\xff\xff", "not CBOR"),
        (b"\x9b\xff\xff\xff\xff\xff\xff\xff\xff", "not CBOR"),
        (b"\x81" * 100_000, "not CBOR"),
        (cbor2.dumps(5), "a message without op"),
        (
            cbor2.dumps({"op": "publish", "topic": "/a", "msg": cbor2.CBORTag(86, b"123")}),
            "CBOR: a typed array of 3 bytes, 8 per number expected",
        ),
    ],
)
def test_what_is_not_rosbridge_is_named_and_the_next_message_counts(data: str | bytes, words: str) -> None:
    ear = MessageAssembler()
    with pytest.raises(RosbridgeProtocolError, match=words):
        ear.feed(data)
    assert isinstance(ear.feed(MESSAGE), Publish)


def test_any_bytes_are_either_heard_or_named() -> None:
    chance = random.Random(3)
    good = cbor2.dumps({"op": "publish", "topic": "/a", "msg": {"position": cbor2.CBORTag(86, bytes(16))}})
    ear = MessageAssembler()
    for _ in range(3000):
        data = bytes(chance.randrange(256) if chance.random() < 0.1 else b for b in good)
        try:
            ear.feed(data[: chance.randrange(len(data) + 1)])
        except RosbridgeProtocolError:
            continue
