"""Ready-made WebSocket messages, read back by the websockets library."""

from __future__ import annotations

import pytest
from posecast_relay.core import messages
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
