"""The bench's C programs compile, find each other, and count what was sent."""

from __future__ import annotations

import json
import shutil
import struct
import subprocess
import sys
import threading
from contextlib import suppress
from itertools import count
from pathlib import Path

import pytest
from websockets import Subprotocol
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

ROOT = Path(__file__).resolve().parents[2]
KEY_HEADER = struct.Struct("<BIId")  # wire format 1: tag, schema id, seq, t s

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc) here")


@pytest.fixture(scope="module")
def programs() -> dict[str, str]:
    build = [sys.executable, "-m", "relay.benches.build"]
    said = subprocess.run(build, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60).stdout
    return dict(line.split(" ", 1) for line in said.splitlines())


@pytest.fixture
def stamps(tmp_path: Path) -> Path:
    path = tmp_path / "stamps"
    path.write_bytes(bytes(65537 * 8))
    return path


def watch(programs: dict[str, str], stamps: Path, *more: str) -> dict[str, object]:
    """What 20 viewers of a bare server at 50 Hz saw."""
    command = [programs["bare_server"], "--hz", "50", "--stamps", str(stamps)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            port = server.stdout.readline().split()[1]
            viewers = [programs["viewers"], "--port", port, "--stamps", str(stamps), "--viewers", "20"]
            viewers += ["--server-pid", str(server.pid), *more]
            done = subprocess.run(viewers, capture_output=True, text=True, check=True, timeout=60)
        finally:
            server.kill()
    seen: dict[str, object] = json.loads(done.stdout)
    return seen


def test_twenty_viewers_see_every_frame_once_and_in_order(programs: dict[str, str], stamps: Path) -> None:
    seen = watch(programs, stamps, "--seconds", "1", "--settle", "0.2")
    messages = seen["messages"]
    assert isinstance(messages, int)
    assert messages > 0
    assert seen["bytes"] == 200 * messages
    assert seen["keys"] == messages
    assert seen["opened"] == 20
    troubles = ("failed", "duplicates", "reordered", "missed", "orphans", "unreadable", "unstamped", "closed")
    assert {name: seen[name] for name in troubles} == dict.fromkeys(troubles, 0)


def test_viewers_acknowledge_once_a_second_at_most(programs: dict[str, str], stamps: Path) -> None:
    seen = watch(programs, stamps, "--seconds", "1", "--settle", "0.2")
    acks = seen["acks"]
    assert isinstance(acks, int)
    assert acks >= 20  # at the first frame
    assert isinstance(seen["wall_s"], float)
    assert acks <= 20 * (seen["wall_s"] + 0.2 + 2)  # the settling and one at either end


def test_frozen_viewers_are_not_counted(programs: dict[str, str], stamps: Path) -> None:
    seen = watch(programs, stamps, "--seconds", "1", "--settle", "0.2", "--frozen", "10")
    assert seen["jain"] == pytest.approx(1.0, abs=0.01)
    assert seen["frozen"] == {"count": 10, "gone": 0, "last_gone_s": 0.0, "backlog_s": 0.0}


def test_all_at_once(programs: dict[str, str], stamps: Path) -> None:
    seen = watch(programs, stamps, "--mode", "storm")
    assert (seen["opened"], seen["failed"]) == (20, 0)


def test_viewers_of_another_protocol(programs: dict[str, str], stamps: Path) -> None:
    """They ask for its subprotocol, greet it, and find the frame behind its own bytes."""
    heard: set[tuple[str | None, str | bytes]] = set()

    def news(connection: ServerConnection) -> None:
        heard.add((connection.subprotocol, connection.recv()))
        connection.send(b"welcome")  # shorter than any frame, so none
        with suppress(ConnectionClosed):
            for seq in count(1):
                connection.send(b"MSG " + KEY_HEADER.pack(0x13, 0, seq, 0.0).ljust(50))
                with suppress(TimeoutError):
                    heard.add(("later", connection.recv(timeout=0.02)))

    with serve(news, "127.0.0.1", 0, subprotocols=[Subprotocol("news")], compression=None) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        port = str(server.socket.getsockname()[1])
        command = [programs["viewers"], "--port", port, "--stamps", str(stamps), "--viewers", "3"]
        command += ["--seconds", "0.5", "--settle", "0.1", "--subprotocol", "news", "--greet", "hex:00ff"]
        command += ["--skip", "4", "--acks", "0"]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
        server.shutdown()
    seen = json.loads(done.stdout)
    assert heard == {("news", b"\x00\xff")}
    assert seen["bytes"] == 50 * seen["messages"]
    assert (seen["unreadable"], seen["acks"], seen["opened"]) == (0, 0, 3)
    assert seen["received"] >= seen["messages"] * (50 + 4 + 2)
