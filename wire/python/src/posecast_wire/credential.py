"""A robot's credential: the line that `posecast-relay robots add` prints, which an edge reads from a file."""

from __future__ import annotations

import base64
import binascii
import re
from dataclasses import dataclass, field

from posecast_wire.keys import ROBOT_ID, check_name

SECRET_LETTERS = 43  # 256 random bits
SECRET = re.compile(rf"[A-Za-z0-9_-]{{{SECRET_LETTERS}}}")
KIND = "posecast1"
LINE_MAX = 20_000


@dataclass(frozen=True)
class Credential:
    """A robot's password. `robot`: its Zenoh user name; `secret`: the password; `ca`: the authority that
    signed the relay's certificate, as PEM, None when it is one that browsers trust."""

    robot: str
    secret: str = field(repr=False)
    ca: str | None = None

    def line(self) -> str:
        """The credential as text: `posecast1:ROBOT:SECRET`, then `:` and the authority in base64 (DER) if
        there is one."""
        import ssl  # noqa: PLC0415 - over 1 MB, which an edge without a certificate does without

        ca = [] if self.ca is None else [base64.b64encode(ssl.PEM_cert_to_DER_cert(self.ca)).decode()]
        return ":".join((KIND, self.robot, self.secret, *ca))

    @classmethod
    def parse(cls, text: str) -> Credential:
        """Parse the text of a credential. Raises ValueError, whose message never contains the secret, when it
        is invalid."""
        lines = [line for raw in text[: LINE_MAX + 1].splitlines() if (line := raw.strip())]
        if len(text) > LINE_MAX or len(lines) != 1:
            raise ValueError("invalid credential: want the one line that `posecast-relay robots add` printed")
        kind, *rest = lines[0].split(":")
        if kind != KIND or not 2 <= len(rest) <= 3:
            raise ValueError(f"invalid credential: want {KIND}:ROBOT:SECRET")
        # a long text in the robot's place may be the secret, so don't quote it
        if len(rest[0]) >= SECRET_LETTERS and not ROBOT_ID.fullmatch(rest[0]):
            raise ValueError("invalid credential: not a robot's name; perhaps the secret is in its place")
        check_name("robot", rest[0])
        if not SECRET.fullmatch(rest[1]):
            raise ValueError("invalid credential: its secret is cut short or mistyped")
        return cls(rest[0], rest[1], _pem(rest[2]) if len(rest) == 3 else None)


def _pem(text: str) -> str:
    import ssl  # noqa: PLC0415 - over 1 MB, and only for a certificate

    try:
        return ssl.DER_cert_to_PEM_cert(base64.b64decode(text, validate=True))
    except (binascii.Error, ValueError):
        raise ValueError("invalid credential: its certificate is cut short or mistyped") from None
