"""What viewers send, and the close code of everything else."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posecast_wire import (
    Ack,
    Auth,
    Close,
    MessageError,
    Ping,
    Rate,
    ViewerMessage,
    clamp_hz,
    parse_viewer_message,
)

from .streams import SLOW


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"type":"rate","hz":0}', Rate(0)),
        ('{"type":"rate","hz":29.97}', Rate(29.97)),
        ('{"type":"ack","n":12}', Ack(12)),
        (b'{"type":"ack","n":12.0}', Ack(12)),
        (b'{"type":"ack","n":12}', Ack(12)),
        (b'{"type":"ack","n":0}', Ack(0)),
        (b'{"type":"ack","n":9007199254740991}', Ack(9007199254740991)),
        ('{"type":"auth","token":"abc"}', Auth("abc")),
        ('{"type":"ping","t":1763706000.5,"more":[]}', Ping(1763706000.5)),
        ('{"type":"put","type":"ping","t":"x","t":-0.0}', Ping(0.0)),
        ('{"type":"auth","token":"\\ud83e\\uddbe"}', Auth("🦾")),
    ],
)
def test_the_four(text: str | bytes, message: ViewerMessage) -> None:
    assert parse_viewer_message(text) == message


@pytest.mark.parametrize(
    ("asked", "hz"),
    [(0, 0), (-0.0, 0), (5e-324, 0.1), (7e-320, 0.1), (0.0999, 0.1), (0.1, 0.1), (1, 1), (1000, 1000)],
)
def test_a_rate_between_0_and_a_tenth_is_a_tenth(asked: float, hz: float) -> None:
    assert clamp_hz(asked) == hz
    assert parse_viewer_message(f'{{"type":"rate","hz":{asked!r}}}') == Rate(hz)


@pytest.mark.parametrize(
    ("text", "close"),
    [
        ("", Close.NOT_ALLOWED),
        ("hello", Close.NOT_ALLOWED),
        ("[]", Close.NOT_ALLOWED),
        ("{}", Close.NOT_ALLOWED),
        ("[" * 4000, Close.NOT_ALLOWED),
        ('{"type":"put","key":"x"}', Close.NOT_ALLOWED),
        ('{"type":["rate"],"hz":1}', Close.NOT_ALLOWED),
        ('{"type":"rate"}', Close.NOT_ALLOWED),
        ('{"type":"rate","hz":-1}', Close.NOT_ALLOWED),
        ('{"type":"rate","hz":NaN}', Close.NOT_ALLOWED),
        ('{"type":"rate","hz":1e999}', Close.NOT_ALLOWED),
        ('{"type":"rate","hz":true}', Close.NOT_ALLOWED),
        ('{"type":"rate","hz":1,"more":1e999}', Close.NOT_ALLOWED),
        ('{"type":"rate","hz":' + "9" * 4000 + "}", Close.NOT_ALLOWED),
        ('{"type":"ack","n":' + "9" * 400 + "}", Close.NOT_ALLOWED),
        (b'\xef\xbb\xbf{"type":"ack","n":1}', Close.NOT_ALLOWED),
        ('{"type":"ack","n":1}'.encode("utf-16"), Close.NOT_UTF8),
        ('{"type":"rate","hz":"10"}', Close.NOT_ALLOWED),
        ('{"type":"ack","n":1.5}', Close.NOT_ALLOWED),
        ('{"type":"ack","n":-1}', Close.NOT_ALLOWED),
        (b'{"type":"ack","n":-1}', Close.NOT_ALLOWED),
        (b'{"type":"ack","n":07}', Close.NOT_ALLOWED),
        (b'{"type":"ack","n":9007199254740993}', Close.NOT_ALLOWED),
        ('{"type":"ack","n":9007199254740993}', Close.NOT_ALLOWED),
        ('{"type":"auth","token":""}', Close.NOT_ALLOWED),
        ('{"type":"auth","token":7}', Close.NOT_ALLOWED),
        ('{"type":"ping"}', Close.NOT_ALLOWED),
        ('{"type":"ping","t":' + "1" * 400 + "}", Close.NOT_ALLOWED),
        ('{"type":"auth","token":"\\ud800"}', Close.NOT_ALLOWED),
        ('{"type":"ping","t":1,"\\udc00":0}', Close.NOT_ALLOWED),
        (b'{"type":"auth","token":"\xed\xa0\x80"}', Close.NOT_UTF8),
        (b'{"type":"auth","token":"\xff"}', Close.NOT_UTF8),
        ('{"type":"auth","token":"\ud800"}', Close.NOT_UTF8),
        (" " * 4097, Close.TOO_LONG),
        ("é" * 2049, Close.TOO_LONG),
    ],
)
def test_everything_else_has_a_close_code(text: str | bytes, close: Close) -> None:
    with pytest.raises(MessageError) as caught:
        parse_viewer_message(text)
    assert caught.value.close == close
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 100


@SLOW
@given(st.binary(max_size=100) | st.text(max_size=100))
def test_noise_only_raises_message_error(noise: str | bytes) -> None:
    with pytest.raises(MessageError):
        parse_viewer_message(noise)
