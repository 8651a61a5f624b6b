"""What relays tell each other: there and back, and nothing else gets in."""

from __future__ import annotations

import gc
import json
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posecast_relay.core.replica import Presence, StreamUpdate
from posecast_relay.redis.messages import BYTES_MAX, pack, unpack, unpack_events, unpack_state

EVENT = '{"type":"event","n":1}'
UPDATE = StreamUpdate("public", 2, 0xE, "p:1", "p:1", 0.25, ((5, b"abc"), (6, b"")), (EVENT,), 7.5)
STATE = {
    b"generation": b"3",
    b"run": b"000000000000000e",
    b"stamp": b"5",
    b"version": b"p:1",
    b"numbering": b"p:1",
    b"schema": b"{}",
    b"info": b"{}",
    b"model": b"",
    b"key": b"k",
    b"frame": b"f",
    b"events": f"[{EVENT}]".encode(),
    b"heard": b"1",
}
views = st.from_regex("[a-z0-9][a-z0-9-]{0,62}", fullmatch=True)
names = st.text(st.characters(codec="utf-8"), max_size=64)
times = st.integers(0, 10**9).map(lambda n: n / 1000)
runs = st.integers(1, (1 << 64) - 1)
events = st.builds(
    lambda n, text: json.dumps(
        {"type": "event", "n": n, "text": text}, separators=(",", ":"), ensure_ascii=False
    ),
    st.integers(0, 1 << 53),
    names,
).filter(lambda text: json.loads(text)["n"] < 1 << 53)
updates = st.builds(
    StreamUpdate,
    view=views,
    generation=st.integers(0, (1 << 53) - 1),
    run_id=runs,
    version=names,
    numbering=names,
    late_s=times,
    frames=st.lists(st.tuples(st.integers(0, 1 << 63), st.binary()), max_size=2).map(tuple),
    events=st.lists(events, max_size=5).map(tuple),
    sent_s=st.none() | times,
)
standings = st.builds(
    Presence,
    token=st.booleans(),
    ages_s=st.dictionaries(views, st.none() | times, max_size=8),
    newest=st.dictionaries(views, st.tuples(runs, st.integers(0, (1 << 32) - 1)), max_size=8),
    sent_s=st.none() | times,
)
strange = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text()
    | st.sampled_from(["\ud800", 1e308 * 10, int("9" * 4000), "0", "1" * 17, "x" * 3000, -1, 1 << 64]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=8,
)


def parts(said: StreamUpdate | Presence) -> tuple[bytes, dict[str, Any], bytes]:
    """Kind, what its JSON says, and the rest."""
    data = pack(said)
    head, newline, rest = data[1:].partition(b"\n")
    return data[:1], json.loads(head), newline + rest


@given(updates | standings)
def test_what_is_packed_is_unpacked(said: StreamUpdate | Presence) -> None:
    assert unpack(pack(said)) == said


def test_an_older_relay_says_less() -> None:
    """While relays are replaced one by one, both kinds are there."""
    for said, left_out in ((UPDATE, ("sent",)), (Presence(True, {"public": 1.0}), ("sent", "newest"))):
        kind, doc, rest = parts(said)
        for name in left_out:
            del doc[name]
        found = unpack(kind + json.dumps(doc).encode() + rest)
        assert found == said._replace(sent_s=None)
    del (fields := dict(STATE))[b"heard"]
    assert unpack_state(fields) == unpack_state(STATE)


@given(st.binary())
def test_bytes_are_refused_by_one_error(data: bytes) -> None:
    for start in (b"", b"U", b"S"):
        with suppress(ValueError):
            unpack(start + data)
    with suppress(ValueError):
        unpack_events(data)
    for name in STATE:
        with suppress(ValueError):
            unpack_state(STATE | {name: data})


@given(
    st.sampled_from([UPDATE, Presence(True, {"public": 1.0}, {"public": (7, 8)}, 1.0)]), strange, st.data()
)
def test_whatever_stands_in_place_of_a_value_is_taken_or_refused_by_one_error(
    said: StreamUpdate | Presence, value: object, data: st.DataObject
) -> None:
    kind, doc, rest = parts(said)
    name = data.draw(st.sampled_from(sorted(doc)))
    doc[name] = data.draw(st.sampled_from([value, [value], {"public": value}, [[5, value], [value, 0]]]))
    with suppress(ValueError):
        found = unpack(kind + json.dumps(doc).encode() + rest)
        assert pack(found)  # what is taken can be told again


@pytest.mark.parametrize(
    "text",
    ['"\\ud800"', "1e999", "9" * 5000, "[" * 100_000, "NaN", "{" * 3000, '{"a":1,"a":2}', "\ufeff1", "-0.0"],
)
def test_odd_json_is_taken_or_refused_by_one_error(text: str) -> None:
    with suppress(ValueError):
        unpack(b'S{"token":true,"ages":{"public":' + text.encode() + b"}}")
    with suppress(ValueError):
        unpack(b'U{"view":"public","late":' + text.encode() + b"}\n")
    for event in (text, '{"type":"event","n":' + text + "}", '{"type":"event","n":1,"text":' + text + "}"):
        with suppress(ValueError):
            for told in unpack_events(f"[{event}]".encode()):
                told.encode()
    for name in (b"info", b"events", b"generation", b"stamp", b"run"):
        with suppress(ValueError):
            unpack_state(STATE | {name: text.encode()})


@pytest.mark.parametrize("cut", [-1, 1])
def test_frames_of_another_length_are_refused(cut: int) -> None:
    data = pack(UPDATE)
    with pytest.raises(ValueError, match="another length"):
        unpack(data[:-1] if cut < 0 else data + b"x")


@pytest.mark.parametrize(
    "change",
    [{"run": "0"}, {"run": "x"}, {"run": "1" * 17}, {"run": "0x1"}, {"run": "1_1"}, {"frames": 1},
     {"frames": [[1]]}, {"frames": [[5, -3], [6, 6]]}, {"frames": [[5, 1]] * 3}, {"events": None},
     {"events": [1]}, {"events": ["{}"]}, {"events": [EVENT] * 101}, {"generation": "x"},
     {"generation": True}, {"generation": -1}, {"generation": 1 << 53}, {"late": None}, {"late": -1},
     {"late": 1e11}, {"late": "1"}, {"numbering": ...}, {"numbering": "x" * 65}, {"view": "Public"},
     {"view": "a/b"}, {"view": None}, {"sent": "1"}],
)  # fmt: skip
def test_a_broken_update_is_refused(change: dict[str, object]) -> None:
    kind, doc, rest = parts(UPDATE)
    doc = {name: value for name, value in (doc | change).items() if value is not ...}
    with pytest.raises(ValueError, match=r"."):
        unpack(kind + json.dumps(doc).encode() + rest)


@pytest.mark.parametrize("name", [name for name in STATE if name != b"heard"])
@pytest.mark.parametrize("value", [None, b"\xff\xfe", bytes(3 << 20)])
def test_a_broken_state_is_refused(name: bytes, value: bytes | None) -> None:
    fields = {k: v for k, v in (STATE | {name: value}).items() if v is not None}
    if value == b"\xff\xfe" and name in (b"key", b"frame"):
        unpack_state(fields)  # frames are not looked into here
        return
    with pytest.raises(ValueError, match=r"."):
        unpack_state(fields)


def test_a_message_has_a_bound() -> None:
    with pytest.raises(ValueError, match="too long"):
        unpack(b"S" + bytes(BYTES_MAX))


@pytest.mark.parametrize(
    "made",
    [
        lambda n: b"S" + b"[" * n,
        lambda n: b"S" + b'{"":' * (n // 4),
        lambda n: b'S{"ages":{' + b",".join(b'"v%x":1' % i for i in range(n // 9)) + b"}}",
        lambda n: b'S{"token":true,"ages":{"a":' + b"9" * n + b"}}",
        lambda n: b'U{"events":[' + b",".join([b'"' + b"\\\\" * 40 + b'"'] * (n // 82)) + b"]}\n",
        lambda n: b'U{"frames":[' + b",".join([b"[0,0]"] * (n // 6)) + b"]}\n",
        lambda n: b"U" + b"\n" * n,
        lambda n: b'U{"view":"' + b"\xf0\x9f\x98\x80" * (n // 4) + b'"}\n',
    ],
)
def test_the_cost_grows_no_faster_than_the_message(made: Callable[[int], bytes]) -> None:
    def cost_s(size: int) -> float:
        data, least = made(size), float("inf")
        for _ in range(5):
            began = time.process_time()
            with suppress(ValueError):
                unpack(data)
            least = min(least, time.process_time() - began)
        return least

    small = BYTES_MAX // 20
    gc.disable()  # what it costs to look through all that other tests left is not the message's
    try:
        assert cost_s(16 * small) < 64 * cost_s(small) + 0.005
    finally:
        gc.enable()
