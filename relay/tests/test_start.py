"""What a relay loads before it serves: a platform starts one for the first viewer, who waits."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import free_port

from .stage import Watcher

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
