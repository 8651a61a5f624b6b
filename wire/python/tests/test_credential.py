"""The line that is pasted at the edge."""

from __future__ import annotations

import base64
import ssl

import pytest
from posecast_wire import Credential

SECRET = "Az09_-x" * 6 + "y"
DER = bytes(range(200))


def test_what_is_printed_is_read_back() -> None:
    plain = Credential("hubo", SECRET)
    assert Credential.parse(plain.line()) == plain
    with_ca = Credential("hubo", SECRET, ssl.DER_cert_to_PEM_cert(DER))
    assert Credential.parse(f"\n {with_ca.line()} \r\n\n") == with_ca
    assert plain.secret not in repr(plain)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "the one line"),
        ("posecast1:r:CANARY\nposecast1:r:CANARY", "the one line"),
        ("CANARY" * 5000, "the one line"),
        ("CANARY", "posecast1:ROBOT:SECRET"),
        ("posecast2:r:" + "C" * 43, "posecast1:ROBOT:SECRET"),
        ("posecast1:r:CANARY", "cut short"),
        ("posecast1:R*:" + "C" * 43, "robot 'R*'"),
        (f"posecast1:CANARY{'C' * 37}:r", "perhaps the secret"),
        (f"posecast1:r:{'C' * 43}:!!", "its certificate"),
        (f"posecast1:r:{'C' * 43}:{base64.b64encode(DER).decode()}:x", "posecast1:ROBOT:SECRET"),
    ],
)
def test_anything_else_is_one_line_that_keeps_the_secret(text: str, says: str) -> None:
    with pytest.raises(ValueError, match=r"invalid credential|robot 'R") as error:
        Credential.parse(text)
    assert says in str(error.value)
    assert "CANARY" not in str(error.value)
    assert "\n" not in str(error.value)
