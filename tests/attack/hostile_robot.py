"""A malicious robot: a session, a run, valid frames to begin with, and answers of its own choice."""

from __future__ import annotations

import base64
import json
import secrets
import struct
import time
from collections.abc import Callable

import zenoh
from posecast_wire import (
    Encoder,
    Schema,
    Snapshot,
    Stamp,
    alive_key,
    build_schema_text,
    event_key,
    frame_key,
    model_key,
    snapshot_key,
)

from tests.attack.target import Target

JOINTS = 20
MATCH_S = 5.0


def open_session(
    at: Target, user: str = "rude", secret: str | None = None, wait_ms: int = 5000
) -> zenoh.Session:
    """A client of this relay that finds nobody else."""
    settings: dict[str, object] = {
        "mode": "client",
        "connect/endpoints": [f"tcp/{at.zenoh}"],
        "connect/timeout_ms": wait_ms,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,
        "transport/shared_memory/enabled": False,
    }
    secret = secret or at.secret
    if secret is not None:
        settings["transport/auth/usrpwd"] = {"user": user, "password": secret}
    config = zenoh.Config()
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


def schema_of(joints: int = JOINTS, name: str = "J") -> Schema:
    """One field of so many channels."""
    fields = [{"name": "pos", "labels": "joint", "unit": "rad", "scale": 0.001}]
    return Schema.parse(build_schema_text("rude", {"joint": [f"{name}{n}" for n in range(joints)]}, fields))


class Robot:
    """`answers`: its reply to a snapshot query; a valid one unless set."""

    def __init__(
        self,
        at: Target,
        name: str = "rude",
        view: str = "public",
        schema: Schema | None = None,
        session: zenoh.Session | None = None,
    ) -> None:
        self.name, self.view = name, view
        self.session = session or open_session(at)
        self.schema = schema or schema_of()
        self.run_id = secrets.randbits(63) | 1
        self.model: str | None = None
        self.model_answer: Callable[[str, dict[str, str]], bytes | None] = lambda _part, _range: None
        self.answers: Callable[[], list[bytes]] = lambda: [self.snapshot()]
        self.asked = 0
        self.seq = 0
        self._began_s = time.monotonic()
        self._encoder = Encoder(self.schema)
        self._key = frame_key(name, view)
        self.frames = self.session.declare_publisher(
            self._key, congestion_control=zenoh.CongestionControl.DROP, priority=zenoh.Priority.REAL_TIME
        )
        self._kept: list[object] = [
            self.session.declare_queryable(snapshot_key(name, view), self._on_question),
            self.session.declare_queryable(model_key(name, "**"), self._on_model),
            self.session.liveliness().declare_token(alive_key(name)),
        ]

    def stamp(self) -> bytes:
        """As it should be."""
        return Stamp(self.run_id, round((time.monotonic() - self._began_s) * 1e9)).pack()

    def frame(self, key: bool = False) -> bytes:
        """The next sound one; every joint moves."""
        self.seq += 1
        now_s = time.monotonic()
        codes = [(self.seq * 7 + n) % 2000 for n in range(self.schema.size)]
        return self._encoder.encode(codes, self.seq, now_s, now_s, force_key=key)

    def put(self, payload: bytes, stamp: bytes | None = None) -> None:
        """A frame, whatever is in it."""
        self.frames.put(payload, attachment=stamp if stamp is not None else self.stamp())

    def tell(self, said: object, stamp: bytes | None = None) -> None:
        """Something for its event key: bytes as they are, else as JSON."""
        payload = said if isinstance(said, bytes) else json.dumps(said)
        self.session.put(
            event_key(self.name, self.view),
            payload,
            attachment=stamp or self.stamp(),
            congestion_control=zenoh.CongestionControl.BLOCK,
        )

    def snapshot(self, schema: str | None = None, info: dict[str, str] | None = None) -> bytes:
        """A valid one with changes."""
        if self._encoder.key is None:
            self.frame(key=True)
        key = self._encoder.key
        assert key is not None
        return Snapshot(schema or self.schema.text, info or {}, key, self.model).pack()

    def on_air(self) -> Robot:
        """Waits until the relay listens and has its schema."""
        end_s = time.monotonic() + MATCH_S
        while not self.frames.matching_status.matching and time.monotonic() < end_s:  # type: ignore[attr-defined]
            time.sleep(0.01)
        self.put(self.frame(key=True))
        while not self.asked and time.monotonic() < end_s:
            time.sleep(0.01)
        time.sleep(0.05)
        self.put(self.frame(key=True))
        return self

    def _on_question(self, query: zenoh.Query) -> None:
        self.asked += 1
        for answer in self.answers():
            query.reply(snapshot_key(self.name, self.view), answer, attachment=self.stamp())

    def _on_model(self, query: zenoh.Query) -> None:
        asked = {name: query.parameters.get(name) or "" for name in ("off", "len")}
        answer = self.model_answer(str(query.key_expr).rsplit("/", 1)[1], asked)
        if answer is not None:
            query.reply(query.key_expr, answer)


def key_frame(schema_id: int, seq: int, size: int, t_s: float = 1.0) -> bytes:
    """A KEY of this many bytes, of which only the header is meaningful."""
    return struct.pack("<BIId", 0x13, schema_id, seq, t_s) + bytes(size - 17)


def plain_frame(base_id: int, distance: int, body: bytes) -> bytes:
    """A plain one against that base."""
    return struct.pack("<BIHH", 0x10, base_id, distance, distance & 0xFFFF) + body


def snapshot_text(schema: str, key: bytes, info: str = "{}") -> bytes:
    """A snapshot written by hand: `info` is JSON text."""
    coded = base64.b64encode(key).decode()
    said = f'"schema":{json.dumps(schema)},"info":{info},"model":null,"key":"{coded}","ref":null'
    return f'{{"v":1,{said}}}'.encode()
