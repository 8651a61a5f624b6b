import base64
import hashlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posecast_loadtests.rfc6455 import (
    Opcode,
    ProtocolError,
    WebSocketReader,
    check_upgrade,
    client_frame,
    upgrade_request,
)


def server_frame(opcode: int, payload: bytes, final: bool = True) -> bytes:
    head = bytes(((0x80 if final else 0) | opcode,))
    if len(payload) < 126:
        return head + bytes((len(payload),)) + payload
    if len(payload) < 1 << 16:
        return head + b"\x7e" + len(payload).to_bytes(2, "big") + payload
    return head + b"\x7f" + len(payload).to_bytes(8, "big") + payload


@given(st.lists(st.binary(max_size=400), max_size=6), st.integers(1, 50))
def test_messages_come_out_whole_however_the_bytes_are_cut(payloads: list[bytes], size: int) -> None:
    stream = b"".join(server_frame(2, payload) for payload in payloads)
    reader = WebSocketReader()
    got = [m for at in range(0, len(stream), size) for m in reader.feed(stream[at : at + size])]
    assert got == [(Opcode.BINARY, payload) for payload in payloads]


def test_long_messages() -> None:
    payload = bytes(70_000)
    assert list(WebSocketReader().feed(server_frame(1, payload))) == [(Opcode.TEXT, payload)]


def test_a_ping_between_fragments_comes_first() -> None:
    stream = server_frame(2, b"ab", final=False) + server_frame(9, b"p") + server_frame(0, b"cd")
    assert list(WebSocketReader().feed(stream)) == [(Opcode.PING, b"p"), (Opcode.BINARY, b"abcd")]


@pytest.mark.parametrize(
    "stream",
    [
        b"\xc2\x00",  # a reserved bit
        b"\x82\x81",  # masked by a server
        b"\x83\x00",  # an opcode nobody knows
        b"\x80\x00",  # a continuation of nothing
        b"\x82\x7f" + (1 << 40).to_bytes(8, "big"),
    ],
)
def test_what_breaks_the_protocol(stream: bytes) -> None:
    with pytest.raises(ProtocolError):
        list(WebSocketReader().feed(stream))


def test_a_client_frame_is_masked() -> None:
    frame = client_frame(Opcode.TEXT, b"hello")
    assert frame[:2] == bytes((0x81, 0x85))
    assert bytes(byte ^ frame[2 + at % 4] for at, byte in enumerate(frame[6:])) == b"hello"


def test_the_upgrade() -> None:
    key = bytes(range(16))
    assert b"Sec-WebSocket-Key: AAECAwQFBgcICQoLDA0ODw==\r\n" in upgrade_request("h:1", "/p?hz=1", key)
    accept = base64.b64encode(
        hashlib.sha1(base64.b64encode(key) + b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11").digest()
    )
    answer = b"HTTP/1.1 101 Switching Protocols\r\nSec-WebSocket-Accept: " + accept + b"\r\n\r\nrest"
    assert check_upgrade(answer, key) == b"rest"
    assert check_upgrade(answer[:40], key) is None
    with pytest.raises(ProtocolError, match="Service Unavailable"):
        check_upgrade(b"HTTP/1.1 503 Service Unavailable\r\n\r\n", key)
    with pytest.raises(ProtocolError, match="Accept"):
        check_upgrade(answer, bytes(16))
