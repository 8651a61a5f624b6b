"""Zenoh names and payloads that edge and relay share: key expressions, the attachment, the snapshot and the
echo."""

from __future__ import annotations

import base64
import binascii
import json
import re
import struct
from typing import NamedTuple

from posecast_wire.checked import TEXT_MAX, is_number, is_text, loads, make_visible
from posecast_wire.messages import TIME_MAX_S

ROBOT_ID = re.compile(r"[a-z0-9][a-z0-9-]{0,62}")
PREFIX = "posecast/v1"
STAMP = struct.Struct("<QQ")
REPLY_BYTES_MAX = 1 << 20  # a schema of 256 KiB as JSON in JSON, two frames in base64, and the info


def check_name(kind: str, name: str) -> str:
    """Return `name` if it may name a robot or view, else raise ValueError. Zenoh itself would accept
    wildcards."""
    if not ROBOT_ID.fullmatch(name):
        raise ValueError(f"{kind} '{make_visible(name)}': use 1 to 63 of a-z, 0-9 and -, not starting with -")
    return name


def _key(robot: str, *rest: str) -> str:
    return "/".join((PREFIX, check_name("robot", robot), *rest))


def alive_key(robot: str) -> str:
    """Key of the edge's liveliness token."""
    return _key(robot, "alive")


def frame_key(robot: str, view: str) -> str:
    """Key on which the edge publishes frames, each with a Stamp as attachment."""
    return _key(robot, check_name("view", view), "frame")


def event_key(robot: str, view: str) -> str:
    """Key on which the edge publishes events as JSON text without `n`, each with a Stamp as attachment."""
    return _key(robot, check_name("view", view), "event")


def snapshot_key(robot: str, view: str) -> str:
    """Key on which the edge answers with a Snapshot and a Stamp as attachment."""
    return _key(robot, check_name("view", view), "snapshot")


def model_key(robot: str, part: str) -> str:
    """Key on which the edge answers about its model. `part`: `manifest`, the SHA-256 of a file, or `**` for
    all of them."""
    if not re.fullmatch(r"manifest|[0-9a-f]{64}|\*\*", part):
        raise ValueError(f"model part '{make_visible(part)}': use manifest, ** or a SHA-256")
    return _key(robot, "model", part)


def echo_key(robot: str) -> str:
    """Key on which the relay answers with an Echo."""
    return _key(robot, "echo")


class Stamp(NamedTuple):
    """The attachment of every frame, event and reply. Run ids are random and are never ordered by value."""

    run_id: int  # u64, never 0
    elapsed_ns: int  # u64, the edge's monotonic clock since the run began

    def pack(self) -> bytes:
        """Encode as 16 bytes, little endian."""
        return STAMP.pack(*self)

    @classmethod
    def unpack(cls, data: bytes) -> Stamp:
        """Decode a stamp. Raises ValueError when `data` is invalid."""
        if len(data) != STAMP.size:
            raise ValueError(f"stamp of {len(data)} bytes, {STAMP.size} wanted")
        stamp = cls(*STAMP.unpack(data))
        if stamp.run_id == 0:
            raise ValueError("stamp with run id 0")
        return stamp


class Snapshot(NamedTuple):
    """All that a late joiner needs before the next frame. `model`: SHA-256 of the model's manifest,
    hexadecimal."""

    schema: str
    info: dict[str, str]
    key: bytes
    model: str | None

    def pack(self) -> bytes:
        """Encode as JSON, with the KEY in base64. `ref` is for older readers, which expect the member."""
        doc = {"v": 1, "schema": self.schema, "info": self.info, "model": self.model}
        doc |= {"key": base64.b64encode(self.key).decode(), "ref": None}
        return json.dumps(doc, separators=(",", ":"), ensure_ascii=False).encode()

    @classmethod
    def unpack(cls, data: bytes) -> Snapshot:
        """Decode a snapshot without checking its schema and frames. Raises ValueError when `data` is
        invalid."""
        doc = _document(data, "snapshot")
        schema, info, model = doc.get("schema"), doc.get("info"), doc.get("model")
        if not isinstance(schema, str):
            raise ValueError("snapshot: schema must be a text")
        if not isinstance(info, dict) or not all(isinstance(v, str) for v in info.values()):
            raise ValueError("snapshot: info must be an object of texts")
        if model is not None and not (isinstance(model, str) and re.fullmatch("[0-9a-f]{64}", model)):
            raise ValueError("snapshot: model must be a SHA-256 or null")
        return cls(schema, info, _read_key_frame(doc), model)


class Echo(NamedTuple):
    """What the relay has received from a robot. `run_id`: 0 if nothing; `relay_time_s`: Unix time, seconds.

    `over`: which limit of the relay the robot exceeds and what is allowed; "" for none.
    """

    run_id: int
    seq: int
    relay_time_s: float
    over: str = ""

    def pack(self) -> bytes:
        """Encode as JSON, with the run id as 16 hexadecimal digits, since numbers in browsers are exact only
        up to 2^53."""
        doc: dict[str, object] = {"run": f"{self.run_id:016x}", "seq": self.seq, "time": self.relay_time_s}
        if self.over:
            doc["over"] = self.over
        return json.dumps(doc, separators=(",", ":")).encode()

    @classmethod
    def unpack(cls, data: bytes) -> Echo:
        """Decode an echo. Raises ValueError when `data` is invalid."""
        doc = _document(data, "echo")
        run, seq, time_s = doc.get("run"), doc.get("seq"), doc.get("time")
        if not isinstance(run, str) or not re.fullmatch("[0-9a-f]{16}", run):
            raise ValueError("echo: run must be 16 hexadecimal digits")
        if isinstance(seq, bool) or not isinstance(seq, int) or not 0 <= seq < 1 << 32:
            raise ValueError("echo: seq must be a u32")
        if not is_number(time_s, 0, TIME_MAX_S):
            raise ValueError("echo: time must be seconds")
        over = doc.get("over", "")
        if over != "" and not is_text(over):
            raise ValueError(f"echo: over must be a text of at most {TEXT_MAX} characters on one line")
        return cls(int(run, 16), seq, float(time_s), over)


def _document(data: bytes, what: str) -> dict[str, object]:
    if len(data) > REPLY_BYTES_MAX:
        raise ValueError(f"{what}: longer than {REPLY_BYTES_MAX} bytes")
    try:
        doc = loads(data)
    except ValueError as e:
        raise ValueError(f"{what}: not JSON: {e}") from None
    if not isinstance(doc, dict):
        raise ValueError(f"{what}: not an object")
    return doc


def _read_key_frame(doc: dict[str, object]) -> bytes:
    text = doc.get("key")
    try:
        if isinstance(text, str):
            return base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        pass
    raise ValueError("snapshot: key must be base64")
