"""Starting and ending the process."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import free_port
from posecast_wire import Close

from .stage import Watcher


def refused(*flags: str) -> str:
    """stderr of a start that ends with status 2."""
    command = [sys.executable, "-m", "posecast_relay.cli", *flags]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    assert done.returncode == 2
    assert done.stdout == ""
    return done.stderr


def test_a_wrong_setting_is_one_line_and_status_2() -> None:
    assert (
        refused("run", "--dev", "--port", "x") == "posecast-relay: --port 'x': use a number from 0 to 65535\n"
    )
    assert refused("run").startswith("posecast-relay: give --robots FILE (who can")


def test_ports_in_use_are_one_line_and_status_2() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        free = ("--port", "0", "--zenoh-listen", "tcp/127.0.0.1:0")
        me = f"{Path('/proc/self/comm').read_text().strip()} (process {os.getpid()})"
        said = refused("run", "--dev", *free, "--port", str(port))
        assert said == f"posecast-relay: http://127.0.0.1:{port}: address already in use by {me}\n"
        said = refused("run", "--dev", *free, "--zenoh-listen", f"tcp/127.0.0.1:{port}")
        assert (
            said == f"posecast-relay: zenoh listener tcp/127.0.0.1:{port}: address already in use by {me}\n"
        )
        said = refused("run", "--dev", *free, "--metrics-port", str(port))
        assert said == f"posecast-relay: --metrics-port {port}: address already in use by {me}\n"


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
async def test_the_end_is_told_and_quick(relays: Any, edges: Any, how: signal.Signals) -> None:
    relay = relays()
    edges(relay.zenoh)
    viewers = [Watcher(relay.url()) for _ in range(3)]
    for viewer in viewers:
        await viewer.__aenter__()
    await viewers[-1].until("frames", lambda v: len(v.frames) > 5)
    relay.process.send_signal(how)
    for viewer in viewers:
        await viewer.until("the end", lambda v: v.closed is not None)
        assert viewer.closed is not None
        assert viewer.closed[0] == Close.DRAIN
        bye = viewer.texts[-1]
        assert (bye["type"], bye["code"], bye["retry_s"]) == ("bye", Close.DRAIN, 0.5)
    assert relay.process.wait(30) == 0
    assert "connections are still open" not in relay.errors()


async def test_a_viewer_that_does_not_answer_the_close_does_not_hold_the_end_up(relays: Any) -> None:
    from .test_websocket import raw_viewer

    relay = relays()
    with raw_viewer(relay) as sock:
        assert sock.recv(1000).startswith(b"HTTP/1.1 101")
        assert relay.stop() == 0
        assert "connections are still open" not in relay.errors()


# ---- what a relay loads before it serves: a platform starts one for the first viewer, who waits ----


HEAVY = ("numpy", "firebase_admin", "google", "grpc", "locust", "gevent", "httpx", "trimesh", "posecast_edge")
REDIS = ("redis", "obstore")


def loaded(module: str, names: tuple[str, ...]) -> set[str]:
    """Those of `names` that importing `module` brings along."""
    program = f"import sys, {module}; print(*(n for n in {names!r} if n in sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_nothing_heavy_is_loaded_to_serve() -> None:
    assert loaded("posecast_relay.server.process", (*HEAVY, *REDIS)) == set()
    gateway = "posecast_relay.server.process, posecast_relay.redis.gateway"
    assert loaded(gateway, (*HEAVY, *REDIS)) == {"redis"}
    assert loaded("posecast_relay.cli", ("fastapi", "zenoh", "uvicorn")) == set()


@pytest.mark.parametrize("roles", [("all",), ("ingest", "gateway")])
async def test_a_relay_keeps_nothing_on_disk(
    relays: Any, edges: Any, redis_server: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, roles: Any
) -> None:
    """Whatever it writes would stand in its own folder, its home or the temporary one."""
    for name in ("here", "home", "tmp"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    port = free_port()
    monkeypatch.setenv("PORT", str(port))
    started = [relays("--role", role, "--store", redis_server.url, http=None) for role in roles[:1]]
    monkeypatch.delenv("PORT")
    assert started[0].http == port
    started += [relays("--role", role, "--store", redis_server.url) for role in roles[1:]]
    edges(started[0].zenoh)
    async with Watcher(started[-1].url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 10)
    for relay in started:
        assert relay.stop() == 0
    assert [path for name in ("here", "home", "tmp") for path in (tmp_path / name).rglob("*")] == []
