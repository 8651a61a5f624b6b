"""Real parts for tests of the adapters: a relay process, an edge on Zenoh and viewers. Ended by pid."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import json
import shutil
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import count, pairwise
from pathlib import Path
from typing import Any

import pytest
import websockets
import zenoh
from posecast_testing import Process, until_async
from posecast_wire import (
    Credential,
    Decoder,
    Echo,
    Frame,
    Schema,
    alive_key,
    echo_key,
    event_key,
    frame_key,
    model_key,
    snapshot_key,
)

from .sim import Edge, schema

START_S = 60.0  # after so long a relay that has said nothing is ended, and its test fails


class Relay(Process):
    """A relay process on free ports."""

    robot = "r"

    def __init__(
        self,
        folder: Path,
        *flags: str,
        http: int | None = 0,
        zenoh_port: int = 0,
        dev: bool = True,
        module: str = "posecast_relay.cli",
    ) -> None:
        scheme = "tls" if "--zenoh-tls-cert" in flags else "tcp"
        listen = f"{scheme}/127.0.0.1:{zenoh_port}"
        command = [sys.executable, "-m", module, "run", *(["--dev"] if dev else [])]
        if http is not None:  # else as the environment says
            command += ["--port", str(http)]
        super().__init__(folder, f"relay-{time.monotonic_ns()}", *command, "--zenoh-listen", listen, *flags)
        try:
            found = self.line(
                r"^posecast-relay: serving http://(127\.0\.0\.1:(\d+)), "
                r"robots (?:on (t(?:cp|ls)/127\.0\.0\.1:(\d+))|from Redis)\n",
                START_S,
            )
        except AssertionError:
            self.kill()
            raise
        self.address, self.http = found[1], int(found[2])
        self.zenoh, self.zenoh_port = found[3] or "", int(found[4] or 0)

    def url(self, robot: str | None = None, query: str = "") -> str:
        """The stream's address."""
        return f"ws://{self.address}/api/v1/robots/{robot or self.robot}/live{query}"

    @property
    def base(self) -> str:
        """Where it serves."""
        return f"http://{self.address}"

    @property
    def path(self) -> str:
        """Of its robot, below `base`."""
        return f"/api/v1/robots/{self.robot}"

    @property
    def api(self) -> str:
        """Its robot's address."""
        return self.base + self.path


UPGRADE = (
    *("Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13"),
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
)


def request_stream(query: str = "", *headers: str) -> bytes:
    """The request for a WebSocket of the robot `r`."""
    lines = [f"GET /api/v1/robots/r/live{query} HTTP/1.1", "Host: x", *UPGRADE, *headers, "", ""]
    return "\r\n".join(lines).encode()


class Wire:
    """A transport that takes everything and keeps it."""

    def __init__(self, peer: str = "192.0.2.1") -> None:
        self.taken = b""
        self.closed = False
        self.reading = True
        self.peer = peer

    def write(self, data: bytes) -> None:
        self.taken += data

    def close(self) -> None:
        self.closed = True

    abort = write_eof = close

    def is_closing(self) -> bool:
        return self.closed

    def can_write_eof(self) -> bool:
        return True

    def get_extra_info(self, name: str) -> Any:
        return (self.peer, 1) if name == "peername" else None

    def set_write_buffer_limits(self, high: int) -> None: ...

    def pause_reading(self) -> None:
        self.reading = False

    def resume_reading(self) -> None:
        self.reading = True

    def get_write_buffer_size(self) -> int:
        return 0


class SharedRelay(Relay):
    """One for many tests, one after the other. Each has a robot of its own, a fresh page and log."""

    _names = count()

    def __init__(self, folder: Path) -> None:
        self.page = folder / "page"
        self._known = 0
        self._write_page()
        super().__init__(folder, "--static", str(self.page))

    def _write_page(self) -> None:
        shutil.rmtree(self.page, ignore_errors=True)
        self.page.mkdir()
        (self.page / "index.html").write_text("page")

    def lend(self) -> None:
        """To the next test."""
        self.robot = f"r{next(self._names)}"
        self._write_page()
        self._known = len(super().errors())

    def errors(self) -> str:
        """Its stderr since this test began."""
        return super().errors()[self._known :]


def client_config(endpoint: str, credential: Credential | None = None) -> zenoh.Config:
    """An edge's session."""
    config = zenoh.Config()
    if credential is not None:
        user = {"user": credential.robot, "password": credential.secret}
        config.insert_json5("transport/auth/usrpwd", json.dumps(user))
        if credential.ca is not None:
            ca = base64.b64encode(credential.ca.encode()).decode()
            config.insert_json5("transport/link/tls/root_ca_certificate_base64", json.dumps(ca))
    for key, value in {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": 5000,
        "connect/retry": {"period_init_ms": 25, "period_max_ms": 200, "period_increase_factor": 2},
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,
        "transport/link/tx/lease": 2500,
        "transport/shared_memory/enabled": False,
    }.items():
        config.insert_json5(key, json.dumps(value))
    return config


class Model:
    """A model bundle, as an edge answers for it."""

    def __init__(self, files: dict[str, tuple[bytes, str]], **more: str) -> None:
        self.files = {hashlib.sha256(data).hexdigest(): data for data, _ in files.values()}
        listed = [
            {"path": path, "uri": path, "size": len(d), "sha256": hashlib.sha256(d).hexdigest(), "type": kind}
            for path, (d, kind) in files.items()
        ]
        self.manifest = json.dumps(
            {"v": 1, "urdf": "robot.urdf", "files": listed, "missing": [], **more}
        ).encode()
        self.digest = hashlib.sha256(self.manifest).hexdigest()
        self.asked: list[str] = []

    def answer(self, key: str, parameters: dict[str, str]) -> bytes | None:
        """The bytes asked for."""
        part = key.rsplit("/", 1)[1]
        self.asked.append(part)
        data = self.manifest if part == "manifest" else self.files.get(part)
        off, size = int(parameters["off"]), int(parameters["len"])
        assert size <= 250_000
        return None if data is None else data[off : off + size]


class ZenohEdge:
    """A robot on air: 30 frames a second from a thread, keys 30 s apart, a snapshot, events, a model.

    `also`: further relays that hear it, as when routers pass it on to all.
    """

    def __init__(
        self,
        endpoint: str,
        robot: str = "r",
        of: Schema | None = None,
        run_id: int = 0xE,
        model: Model | None = None,
        also: Sequence[str] = (),
        credential: Credential | None = None,
        view: str = "public",
    ) -> None:
        self.robot = robot
        self.view = view
        self.edge = Edge(run_id, of or schema(), began_s=time.monotonic())
        self.edge.model = model.digest if model else None
        self.model = model
        self.force_key = False
        self.lose_next_key = False
        self.lost_at: float | None = None
        self.silent = False
        self.waits: Callable[[], bool] = lambda: False  # while it says so, no frame is made
        self.hz = 30.0
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self.sessions = [zenoh.open(client_config(each, credential)) for each in (endpoint, *also)]
        self.session = self.sessions[0]
        self._keep: list[object] = []
        self._frames: list[zenoh.Publisher] = []
        for session in self.sessions:
            self._keep += [
                session.declare_queryable(snapshot_key(robot, view), self._on_snapshot),
                session.declare_queryable(model_key(robot, "**"), self._on_model),
                session.liveliness().declare_token(alive_key(robot)),
            ]
            self._frames.append(
                session.declare_publisher(
                    frame_key(robot, view),
                    priority=zenoh.Priority.REAL_TIME,
                    congestion_control=zenoh.CongestionControl.DROP,
                )
            )
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def seq(self) -> int:
        """Of its newest frame."""
        return self.edge.seq

    def _run(self) -> None:
        due_s = time.monotonic()
        while not self._stop.wait(max(0.0, due_s - time.monotonic())):
            due_s += 1 / self.hz
            if due_s < time.monotonic():  # what a loaded machine held up is not made up for
                due_s = time.monotonic() + 1 / self.hz
            if self.silent or self.waits():
                continue
            now = time.monotonic()
            with self._lock:
                payload = self.edge.frame(now, force_key=self.force_key)
            self.force_key = False
            if self.lose_next_key and payload[0] & 1:
                self.lose_next_key, self.lost_at = False, now
                continue
            for frames in self._frames:
                frames.put(payload, attachment=self.edge.stamp(now).pack())

    def _on_snapshot(self, query: zenoh.Query) -> None:
        with self._lock:
            if self.edge.seq < 0:
                return
            answer = self.edge.snapshot().pack()
        stamp = self.edge.stamp(time.monotonic()).pack()
        query.reply(snapshot_key(self.robot, self.view), answer, attachment=stamp)

    def _on_model(self, query: zenoh.Query) -> None:
        if self.model is not None:
            asked = {name: query.parameters.get(name) or "" for name in ("off", "len")}
            answer = self.model.answer(str(query.key_expr), asked)
            if answer is not None:
                query.reply(query.key_expr, answer)

    def event(self, text: str, state: str = "on") -> None:
        """Send one."""
        doc = {"type": "event", "t": 1.0, "level": "fault", "source": "RKN", "text": text, "state": state}
        stamp = self.edge.stamp(time.monotonic()).pack()
        for session in self.sessions:
            session.put(
                event_key(self.robot, self.view),
                json.dumps(doc),
                attachment=stamp,
                congestion_control=zenoh.CongestionControl.BLOCK,
            )

    def echo(self) -> Echo | None:
        """What the relay says it has."""
        for reply in self.session.get(echo_key(self.robot), timeout=2.0):
            if reply.ok is not None:
                return Echo.unpack(reply.ok.payload.to_bytes())
        return None

    def close(self) -> None:
        """Go off air."""
        self._stop.set()
        self._thread.join()
        for session in self.sessions:
            session.close()  # type: ignore[no-untyped-call]


class Watcher:
    """A viewer: decodes, acknowledges as our page does, remembers when what came."""

    def __init__(self, url: str, acks: bool = True, sock: socket.socket | None = None) -> None:
        """`sock`: a connection to the relay that is there already."""
        self.url = url
        self._sock = sock
        self.acks = acks
        self.texts: list[dict[str, Any]] = []
        self.frames: list[tuple[float, Frame]] = []
        self.payloads: dict[int, bytes] = {}  # by seq
        self.closed: tuple[int, str] | None = None
        self.connection: websockets.ClientConnection | None = None
        self._task: asyncio.Task[None] | None = None

    async def __aenter__(self) -> Watcher:
        self.connection = await websockets.connect(self.url, sock=self._sock)
        self._task = asyncio.create_task(self._watch(self.connection))
        return self

    async def __aexit__(self, *error: object) -> None:
        assert self._task is not None
        assert self.connection is not None
        await self.connection.close()
        await self._task

    async def _watch(self, connection: websockets.ClientConnection) -> None:
        decoder, count, acked_at = Decoder(), 0, float("-inf")
        try:
            async for message in connection:
                if isinstance(message, str):
                    self.texts.append(json.loads(message))
                    if self.texts[-1]["type"] == "schema":
                        decoder.add_schema(message)
                    continue
                count += 1
                now = time.monotonic()
                self.frames.append((now, decoder.decode(message)))
                self.payloads[self.frames[-1][1].seq] = message
                if self.acks and now - acked_at >= 1.0:
                    acked_at = now
                    await connection.send(json.dumps({"type": "ack", "n": count}))
        except websockets.ConnectionClosed:
            pass
        self.closed = (connection.close_code or 0, connection.close_reason or "")

    def told(self, kind: str) -> list[dict[str, Any]]:
        """The messages of one type."""
        return [doc for doc in self.texts if doc["type"] == kind]

    async def until(self, what: str, probe: Callable[[Watcher], object], deadline_s: float = 20.0) -> None:
        """Wait for something to be true of this viewer."""
        try:
            await until_async(what, lambda: probe(self), deadline_s)
        except AssertionError as e:
            raise AssertionError(f"{e}; closed {self.closed}") from None

    def most_missed(self, since_seq: int) -> int:
        """The most frames of the robot that went by between two that came: its longest gap, in frames."""
        seqs = [frame.seq for _, frame in self.frames if frame.seq >= since_seq]
        return max((b - a - 1 for a, b in pairwise(seqs)), default=1 << 32)


@pytest.fixture
def relays(tmp_path: Path) -> Iterator[Callable[..., Relay]]:
    """Starts relays; all are ended, and none may have left a traceback."""
    started: list[Relay] = []

    def start(*flags: str, **how: Any) -> Relay:
        started.append(Relay(tmp_path, *flags, **how))
        return started[-1]

    yield start
    for relay in started:
        was_running = relay.process.poll() is None
        assert relay.stop() != -signal.SIGKILL or not was_running, "it did not end by SIGTERM"
        assert "Traceback" not in relay.errors(), relay.errors()


@pytest.fixture(scope="session")
def _shared_relays() -> Iterator[list[SharedRelay]]:
    """The last one is in use; those before it have ended."""
    started: list[SharedRelay] = []
    yield started
    for relay in started:
        was_running = relay.process.poll() is None
        assert relay.stop() != -signal.SIGKILL or not was_running, "it did not end by SIGTERM"


@pytest.fixture
def relay(
    _shared_relays: list[SharedRelay], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[SharedRelay]:
    """For tests that need no flags, and leave it running: it starts once. None may leave a traceback."""
    if not _shared_relays or _shared_relays[-1].process.poll() is not None:
        _shared_relays.append(SharedRelay(tmp_path_factory.mktemp("relay")))
    relay = _shared_relays[-1]
    relay.lend()
    yield relay
    assert relay.process.poll() is None, relay.log
    assert "Traceback" not in relay.errors(), relay.errors()


@pytest.fixture
def edges() -> Iterator[Callable[..., ZenohEdge]]:
    """Puts robots on air; all go off air."""
    started: list[ZenohEdge] = []

    def start(at: str | Relay, **how: Any) -> ZenohEdge:
        if isinstance(at, Relay):
            started.append(ZenohEdge(at.zenoh, **{"robot": at.robot} | how))
        else:
            started.append(ZenohEdge(at, **how))
        return started[-1]

    yield start
    for edge in started:
        edge.close()
