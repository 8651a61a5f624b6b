"""Redis over TLS and with a password, with certificates made here."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from posecast_testing import until

from .certificates import certificates
from .redis_server import Redis
from .stage import Watcher

PASSWORD = "CANARY-7319"


@pytest.fixture
def tls_redis(tmp_path: Path) -> Iterator[Redis]:
    """Speaks TLS only."""
    if shutil.which("redis-server") is None:
        pytest.skip("no redis-server here")
    certificates(tmp_path, "redis")
    server = Redis(tmp_path, "--requirepass", PASSWORD, "--tls-auth-clients", "no")
    server.start(tls=tmp_path)
    server.url = f"rediss://:{PASSWORD}@127.0.0.1:{server.port}?ssl_ca_certs={tmp_path / 'ca.pem'}"
    yield server
    server.kill()


async def test_roles_meet_over_tls_and_whoever_cannot_check_the_server_does_not_talk_to_it(
    relays: Any, edges: Any, tls_redis: Redis
) -> None:
    ingest = relays("--role", "ingest", "--store", tls_redis.url)
    gateway = relays("--role", "gateway", "--store", tls_redis.url)
    stranger = relays("--role", "gateway", "--store", tls_redis.url.partition("?")[0])
    edges(ingest.zenoh)
    async with Watcher(gateway.url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 20)
    ready = f"http://{gateway.address}/readyz"
    until("the past is read, too", lambda: httpx.get(ready).json() == {"status": "ready"})
    until("it says why", lambda: "CERTIFICATE_VERIFY_FAILED" in stranger.errors())
    said = httpx.get(f"http://{stranger.address}/readyz").json()
    assert said["status"] == "degraded"
    for relay in (ingest, gateway, stranger):
        assert PASSWORD not in relay.errors() + str(said)
