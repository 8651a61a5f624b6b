"""Encodes a deletion of the past, as it stands in an object store (a tombstone), in Redis, and on the way
from the command to a relay.

What is read isn't trusted: whatever is malformed, or of another version, raises ValueError with a message of
one line.
"""

from __future__ import annotations

import re
import secrets

from posecast_wire import check_name
from posecast_wire.checked import loads

from posecast_relay.kit import json_bytes
from posecast_relay.past.deletions import Deletion

VERSION = 1
RECORD_BYTES_MAX = 4096
WHOLE_MAX = (1 << 53) - 1
ID = re.compile("[0-9a-f]{16}", re.ASCII)


def make_deletion(robot: str, view: str | None, from_ms: int, to_ms: int, now_ms: int) -> Deletion:
    """Order a deletion of what lies between two times, unix ms; it ends now at the latest."""
    return Deletion(robot, view, from_ms, min(to_ms, now_ms), now_ms, secrets.token_hex(8))


def pack_deletion(deletion: Deletion) -> bytes:
    """Encode a deletion."""
    return json_bytes(
        {
            "v": VERSION,
            "robot": deletion.robot,
            "view": deletion.view,
            "from_ms": deletion.from_ms,
            "to_ms": deletion.to_ms,
            "at_ms": deletion.at_ms,
            "id": deletion.id,
        }
    )


def unpack_deletion(data: bytes) -> Deletion:
    """Read a deletion. Raises ValueError when it is none."""
    if len(data) > RECORD_BYTES_MAX:
        raise ValueError("deletion: too long")
    doc = loads(data)
    if not isinstance(doc, dict):
        raise ValueError("deletion: no object")
    if doc.get("v") != VERSION:
        raise ValueError(f"deletion: of version {doc.get('v')!r:.20}")
    robot, view, id_ = doc.get("robot"), doc.get("view"), doc.get("id")
    if not isinstance(robot, str) or not (view is None or isinstance(view, str)):
        raise ValueError("deletion: robot or view is none")
    if not isinstance(id_, str) or not ID.fullmatch(id_):
        raise ValueError("deletion: id is none")
    from_ms, to_ms, at_ms = (_read_ms(doc.get(name)) for name in ("from_ms", "to_ms", "at_ms"))
    if not from_ms <= to_ms <= at_ms:
        raise ValueError("deletion: no span of time that was over when it was ordered")
    check_name("robot", robot)
    if view is not None:
        check_name("view", view)
    return Deletion(robot, view, from_ms, to_ms, at_ms, id_)


def _read_ms(found: object) -> int:
    if type(found) is not int or not 0 <= found <= WHOLE_MAX:
        raise ValueError("deletion: a time is none")
    return found
