"""Ready-made WebSocket messages, read back by the websockets library."""

from __future__ import annotations

import json

import pytest
from posecast_relay.core import messages
from posecast_relay.core.limits import Limits
from posecast_relay.core.messages import make_conflict_event, read_edge_message
from websockets.client import ClientProtocol
from websockets.frames import Frame, Opcode
from websockets.protocol import OPEN
from websockets.uri import parse_uri


@pytest.mark.parametrize("size", [0, 1, 125, 126, 127, 65535, 65536, 100_000])
def test_packed_messages_are_what_the_library_reads(size: int) -> None:
    reader = ClientProtocol(parse_uri("ws://x/"), state=OPEN)
    reader.receive_data(messages.make_binary(b"b" * size) + messages.make_text("t" * size) + messages.PING)
    read = [event for event in reader.events_received() if isinstance(event, Frame)]
    assert [frame.opcode for frame in read] == [Opcode.BINARY, Opcode.TEXT, Opcode.PING]
    assert [bytes(frame.data) for frame in read] == [b"b" * size, b"t" * size, b""]
    assert all(frame.fin for frame in read)


# ---- what an edge says beside its frames, read as a stranger's -----------------------


EVENT = {"type": "event", "t": 1.5, "level": "fault", "source": "RKN", "text": "jam", "state": "on"}


def said(doc: object) -> dict[str, object] | None:
    """As JSON."""
    return read_edge_message(json.dumps(doc).encode(), Limits())


def test_what_an_edge_says() -> None:
    assert said(EVENT) == EVENT
    info: dict[str, object] = {"type": "info", "kv": {"battery": "80 %"}}
    assert said(info) == info
    model: dict[str, object] = {"type": "model", "hash": "0" * 64}
    assert said(model) == model


def test_members_that_nobody_knows_are_left_out() -> None:
    assert said(EVENT | {"n": 7, "at": 1e999, "": {}}) is None  # 1e999 is no number that can be written again
    assert said(EVENT | {"n": 7, "at": 5, "": {}}) == EVENT


@pytest.mark.parametrize(
    "change",
    [
        {"t": True},
        {"t": None},
        {"t": 1e13},
        {"t": -1e300},
        {"level": "worse"},
        {"level": ["fault"]},
        {"level": {}},
        {"state": 1},
        {"state": []},
        {"source": None},
        {"text": "\ud800"},
        {"source": "a\udfff"},
        {"type": ["event"]},
        {"type": "schema"},
        {"text": "x" * 2048},
    ],
)
def test_an_event_that_not_every_viewer_could_read_is_none(change: dict[str, object]) -> None:
    assert said(EVENT | change) is None


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"[]",
        b"null",
        b"\xff",
        b"\xef\xbb\xbf{}",
        b'{"type":"info","kv":{"a":1}}',
        b'{"type":"info","kv":[]}',
        b'{"type":"info","kv":{"\\ud800":"x"}}',
        b'{"type":"info","kv":{"x":"\\udc00"}}',
        b"[" * 10_000,
        b'{"type":"event","t":' + b"9" * 1500 + b"}",
        b'{"type":"model","hash":"' + b"A" * 64 + b'"}',
        b'{"type":"event","t":' + b"9" * 5000 + b"}",
    ],
)
def test_what_is_none_of_them(payload: bytes) -> None:
    assert read_edge_message(payload, Limits()) is None


def test_the_relays_own_event_can_be_read_whatever_the_robots_clock_says() -> None:
    for t_s in (0.0, 1e300, -1e300):
        assert said(make_conflict_event(t_s, True)) is not None
