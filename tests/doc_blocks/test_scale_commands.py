"""The commands of docs/how-to/scale with Redis and gateways, and those of others that need Redis."""

from __future__ import annotations

import html
import re
import shutil
import subprocess
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import redis
from posecast_testing import free_port, until

from relay.tests.certificates import certificates
from relay.tests.redis_server import Redis
from tests.conftest import BIN
from tests.doc_blocks.block import ROOT, read_pages
from tests.doc_blocks.terminal import START_S, Terminal, fetch, find_line, read_script, read_scripts

SCALE, OPERATE = "docs/how-to/scale", "docs/how-to/operate"
ADDRESS = re.compile(r"rediss?://:PASSWORD@(?:redis\.example|127\.0\.0\.1):6379/0")

needs_redis = pytest.mark.skipif(shutil.which("redis-server") is None, reason="no redis-server here")


@pytest.fixture
def terminal(stack: Any, tmp_path: Path) -> Terminal:
    """With a relay's certificate and a robots file."""
    certificates(tmp_path, "relay", "DNS:localhost")
    terminal = Terminal(stack, tmp_path, {"0.0.0.0:7447": "127.0.0.1:0"})
    terminal.run(
        "umask 077; posecast-relay robots add hubo --robots robots.toml --ca ca.pem > hubo.credential"
    )
    return terminal


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Redis]:
    """With the pages' password."""
    made = Redis(tmp_path, "--requirepass", "PASSWORD")
    made.launch()
    made.url = f"redis://:PASSWORD@127.0.0.1:{made.port}/0"
    until("redis answers", lambda: can_reach(made.url))
    yield made
    made.kill()


def can_reach(url: str) -> bool:
    try:
        with redis.Redis.from_url(url) as client:
            return bool(client.ping())
    except redis.ConnectionError:
        return False


def start_hubo(terminal: Terminal, zenoh: str) -> None:
    run = "posecast-edge run --credential hubo.credential --source demo --relay"
    terminal.start(f"{run} {zenoh.replace('127.0.0.1', 'localhost')}")


def is_online(http: str) -> bool:
    found = fetch(f"http://{http}/api/v1/robots/hubo/state")
    return bool(found and found["status"] == "online")


@needs_redis
@pytest.mark.skipif(not (BIN / "caddy").exists(), reason="no caddy in the virtual environment")
def test_gateways_use_the_cores_of_one_machine(terminal: Terminal, server: Redis, tmp_path: Path) -> None:
    page = f"{SCALE}/gateways.md"
    export, relay, gateway = read_scripts(page)[:3]
    (proxy,) = [block.text for block in read_pages()[page] if "reverse_proxy" in block.text]
    assert len(ADDRESS.findall(export)) == 1
    export = ADDRESS.sub(server.url, export)
    tls = "--zenoh-listen tls/0.0.0.0:7447 --zenoh-tls-cert relay.pem --zenoh-tls-key relay.key"
    first = terminal.start(f"{export}\n{relay.strip()} {tls}", "--port", "0")
    addresses = [find_line(first, r"serving http://(\S+),")[1]]
    for _ in range(2):
        serves = terminal.start(f"{export}\n{gateway.replace('8081', '0')}")
        addresses.append(find_line(serves, r"serving http://(\S+), robots from Redis")[1])
    for shown, mine in zip(re.findall(r"127\.0\.0\.1:\d+", proxy), addresses, strict=True):
        proxy = proxy.replace(shown, mine)
    start_hubo(terminal, find_line(first, r"robots on (tls/\S+)")[1])
    for http in addresses:
        until("it is online", partial(is_online, http), START_S)
    port = free_port()
    (tmp_path / "Caddyfile").write_text(f"{{\nadmin off\n}}\n:{port} {{\n{proxy}\n}}\n")
    terminal.start("caddy run --adapter caddyfile --config Caddyfile")
    until("the proxy answers", lambda: is_online(f"127.0.0.1:{port}"), START_S)
    assert all(is_online(f"127.0.0.1:{port}") for _ in range(10)), "whichever process it asks"


@needs_redis
def test_a_gateway_shows_what_the_ingest_hears(terminal: Terminal, server: Redis) -> None:
    page = f"{SCALE}/gateways.md"
    export, ingest, gateway = read_scripts(page)[3:]
    assert len(ADDRESS.findall(export)) == 1
    export = ADDRESS.sub(server.url, export)
    hears = terminal.start(f"{export}\n{ingest}", "--port", "0")
    zenoh = find_line(hears, r"robots on (tls/\S+)")[1]
    serves = terminal.start(f"{export}\n{gateway.replace('0.0.0.0', '127.0.0.1')}", "--port", "0")
    http = find_line(serves, r"serving http://(\S+), robots from Redis")[1]
    start_hubo(terminal, zenoh)
    until("it is online at the gateway", lambda: is_online(http), START_S)


@needs_redis
def test_a_relay_reaches_redis_with_tls(terminal: Terminal, tmp_path: Path) -> None:
    folder = tmp_path / "redis"
    folder.mkdir()
    certificates(folder, "redis")
    server = Redis(folder, "--requirepass", "PASSWORD", "--tls-auth-clients", "no")
    server.start(tls=folder)
    try:
        script = read_script(f"{SCALE}/redis.md", "export")
        own = f"rediss://:PASSWORD@127.0.0.1:{server.port}/0?ssl_ca_certs={folder}/ca.pem"
        assert len(ADDRESS.findall(script)) == 1
        tls = "--zenoh-listen tls/127.0.0.1:0 --zenoh-tls-cert relay.pem --zenoh-tls-key relay.key"
        relay = terminal.start(f"{ADDRESS.sub(own, script).strip()} {tls}", "--port", "0")
        http = find_line(relay, r"serving http://(\S+),")[1]
        until("it is ready", lambda: (fetch(f"http://{http}/readyz") or {}).get("status") == "ready")
    finally:
        server.kill()


@needs_redis
def test_the_past_is_deleted_by_hand(terminal: Terminal, server: Redis) -> None:
    name, every, one = read_script(f"{OPERATE}/delete-the-past.md", "redis-cli").splitlines()
    terminal.variables = {"POSECAST_STORE": server.url}
    live = {"posecast:{hubo}:public:state", "posecast:{g1}:public:state"}
    past = {f"posecast:{{{robot}}}:past:{n}" for robot in ("hubo", "g1") for n in range(3)}
    with redis.Redis.from_url(server.url, decode_responses=True) as client:
        for key in live | past:
            client.set(key, "kept")
        terminal.run(f"{name}\n{one}")
        assert set(client.keys()) == live | {key for key in past if "{g1}" in key}
        terminal.run(f"{name}\n{every}")
        assert set(client.keys()) == live


@needs_redis
def test_the_latency_of_redis_is_measured(terminal: Terminal, server: Redis) -> None:
    name, latency, slow = read_script(f"{OPERATE}/troubleshoot-storage.md", "redis-cli").splitlines()
    terminal.variables = {"POSECAST_STORE": server.url}
    assert re.fullmatch(r"[\d. ]+\n", terminal.run(f"{name}\n{latency}"))
    assert "AUTH" not in terminal.run(f"{name}\n{slow}")


@pytest.mark.skipif(not (ROOT / "spa/dist/index.html").exists(), reason="no built page: run make setup")
def test_the_policy_of_the_built_page_is_printed() -> None:
    command = read_script(f"{SCALE}/host-the-page.md", "policy.mjs")
    done = subprocess.run(command.split(), cwd=ROOT, capture_output=True, text=True, check=True, timeout=60)
    page = (ROOT / "spa/dist/index.html").read_text(encoding="utf-8")
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy"\s+content="([^"]+)"', page)
    assert html.unescape(policy) in done.stdout
