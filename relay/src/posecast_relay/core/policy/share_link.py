"""Share links: signed texts that let the holder see one robot until they expire. Nothing is stored."""

from __future__ import annotations

import base64
import hashlib
import hmac
import re
from collections.abc import Mapping

from posecast_relay.core.policy.policy import Audience, Principal

KIND = "L1"
FORM = re.compile(
    r"(L1\.([a-z0-9][a-z0-9-]{0,62})\.([1-9][0-9]{0,11})\.[A-Za-z0-9_-]{8})\.([A-Za-z0-9_-]{43})"
)
NO_KEY = "no such robot"  # signs nothing; makes the check for an unknown robot take the same time


def make_link(key: str, robot: str, until_s: int, name: str) -> str:
    """Sign a link that opens `robot` until `until_s`, unix s.

    `name`: 8 letters of base64url that make the link unique.
    """
    said = f"{KIND}.{robot}.{until_s}.{name}"
    return f"{said}.{_sign(key, said)}"


def is_link(token: str) -> bool:
    """Whether a token looks like a share link. Does not check its signature."""
    return token.startswith(KIND + ".")


def read_link(token: str, keys: Mapping[str, str], unix_s: float) -> Principal | None:
    """Return the holder of the link; None if it is malformed, wrongly signed or expired. `keys`: by robot."""
    found = FORM.fullmatch(token)
    if found is None:
        return None
    said, robot, until_s, signature = found.groups()
    key = keys.get(robot)
    good = hmac.compare_digest(_sign(NO_KEY if key is None else key, said), signature)
    if key is None or not good or unix_s >= int(until_s):
        return None
    return Principal(Audience.LINK, robot, float(until_s), token)


def _sign(key: str, said: str) -> str:
    raw = hmac.digest(key.encode(), said.encode(), hashlib.sha256)
    return base64.urlsafe_b64encode(raw).rstrip(b"=").decode()
