"""infra/docker-compose.yml on a real Docker engine: `make compose-test`. Skipped if there is none."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import subprocess
import urllib.request
from pathlib import Path
from typing import Any

import pytest
import websockets
from posecast_testing import until
from posecast_wire.decoder import Decoder

from tests.compose.engine import ROOT, docker
from tests.compose.recipes import ADMIN, carry_out
from tests.conftest import BIN

pytestmark = pytest.mark.full

MB = 1e6
SERVICES = {"relay", "robots", "proxy", "redis", "demo"}
PUBLISHED = {"proxy": {"80/tcp", "443/tcp"}, "robots": {"7447/tcp"}}


def test_from_nothing_to_a_moving_robot(cloud: Any, record_testsuite_property: Any) -> None:
    sizes = {name: int(docker("image", "inspect", "-f", "{{.Size}}", name)) / MB for name in IMAGES}
    over = {name: sizes[name] - sizes[base] for name, base in IMAGES.items() if base}
    shown = ", ".join(f"{name} {size:.0f} MB over its base" for name, size in over.items())
    print(f"from `up` to a robot that moves {cloud.seconds_to_move:.1f} s; {shown}")
    record_testsuite_property("moving_s", round(cloud.seconds_to_move, 1))
    assert over["posecast"] <= 160


IMAGES = {
    "posecast": "python:3.11-slim-bookworm",
    "posecast-proxy": "caddy:2",
    "python:3.11-slim-bookworm": "",
    "caddy:2": "",
}


async def test_frames_come_over_tls(cloud: Any) -> None:
    url = cloud.url.replace("https", "wss") + "/api/v1/robots/demo/live?hz=30"
    decoder, decoded = Decoder(), 0
    async with websockets.connect(url, ssl=cloud.trust, proxy=None) as link:
        while decoded < 30:
            message = await asyncio.wait_for(link.recv(), 20)
            if isinstance(message, bytes):
                decoder.decode(message)
                decoded += 1
            elif json.loads(message)["type"] == "schema":
                decoder.add_schema(message)


def test_page_and_routes_come_with_their_headers(cloud: Any) -> None:
    def headers(path: str) -> Any:
        with urllib.request.urlopen(cloud.url + path, timeout=5, context=cloud.trust) as answer:
            return answer.headers

    with urllib.request.urlopen(cloud.url, timeout=5, context=cloud.trust) as answer:
        asset = re.findall(r"\./(assets/[^\"]+\.js)", answer.read().decode())[0]
    # the same policy as a header also applies to the page's workers
    assert "default-src 'self'" in headers(f"/{asset}")["content-security-policy"]
    assert headers("/")["content-security-policy"].endswith("; frame-ancestors 'none'")
    # whoever the file of robots lets see the demo robot may frame it
    assert headers("/embed/demo")["content-security-policy"].endswith("; frame-ancestors *")
    assert headers("/embed/")["content-security-policy"].endswith("; frame-ancestors 'self'")
    assert headers("/docs/")["content-security-policy"] is None, "its own stand in it"
    assert "/api/v1/robots" in cloud.get("/openapi.json")["paths"]


def play(cloud: Any, *files: str, **settings: str) -> dict[str, int]:
    """Runs browser tests against the cloud instead of their own relay: how many passed, how many were
    skipped."""
    here = {"POSECAST_URL": cloud.url, "NODE_EXTRA_CA_CERTS": str(cloud.authority)}
    words = ("npm", "run", "--silent", "e2e", "-w", "spa", "--", "--retry=1", "--reporter=verbose")
    done = subprocess.run(
        [*words, *(f"e2e/{file}.test.ts" for file in files)],
        cwd=ROOT,
        env={**os.environ, **here, "NO_COLOR": "1", **settings},
        capture_output=True,
        text=True,
        check=False,
        timeout=1200,
    )
    print(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr
    (line,) = re.findall(r"^ +Tests +(.*)$", done.stdout, re.MULTILINE)
    return {what: int(count) for count, what in re.findall(r"(\d+) (passed|skipped)", line)}


def test_a_browser_sees_it(cloud: Any) -> None:
    assert play(cloud, "deployed") == {"passed": 1}


# The browser tests for everything between robot and page that a proxy can break. Tests that need a relay's
# process, settings or plain port skip themselves. Caching between visits is not tested here: a browser stores
# nothing behind a certificate that it does not trust.
PLAYED = ("share", "elsewhere", "policy", "table", "unseen", "everyone", "liveness", "faults", "model")
ROBOTS = ("first", "second")  # beside `demo`


def test_the_browser_tests_pass_over_tls(cloud: Any, tmp_path: Path) -> None:
    (relay,), (redis,) = cloud.project.containers("relay"), cloud.project.containers("redis")
    cloud.project.compose("stop", "demo")  # its name is the tests' meanwhile
    lines = {"demo": docker("exec", relay, "cat", "/secret/demo.credential")}
    enrol = ("posecast-relay", "robots", "add", "--ca", "/secret/ca.pem")
    lines |= {robot: docker("exec", relay, *enrol, robot) for robot in ROBOTS}
    for robot, line in lines.items():
        (tmp_path / robot).touch(0o600)
        (tmp_path / robot).write_text(line)
    try:
        found = play(
            cloud,
            *PLAYED,
            POSECAST_ROBOTS_AT=f"tls/localhost:{cloud.project.robots_port}",
            POSECAST_CREDENTIALS=str(tmp_path),
            POSECAST_FORGET=f"docker restart -t 0 {redis} {relay}",  # Redis keeps nothing on disk
        )
        print(found)
        assert found["passed"] >= 20, found
    finally:
        cloud.project.compose("--profile", "demo", "up", "--detach", "--wait", limit_s=180)
    cloud.until_moves()


def test_nobody_but_the_proxy_is_reached_from_outside(cloud: Any) -> None:
    for service in SERVICES:
        for container in cloud.project.containers(service):
            ports = cloud.project.inspect(container)["NetworkSettings"]["Ports"] or {}
            assert {port for port, at in ports.items() if at} == PUBLISHED.get(service, set()), service
    # and who shares a network with the proxy's outside finds neither relay nor Redis
    probe = (
        "import socket\n"
        "for host, port in (('relay', 8080), ('redis', 6379)):\n"
        "    try: socket.create_connection((host, port), 2); print('reached', host)\n"
        "    except OSError: pass\n"
    )
    network = f"{cloud.project.name}_web"
    assert docker("run", "--rm", "--network", network, "posecast", "python3", "-c", probe) == ""


def test_a_robot_comes_in_with_a_credential(cloud: Any, stack: Any, tmp_path: Path) -> None:
    (relay,) = cloud.project.containers("relay")
    enrol = ("posecast-relay", "robots", "add", "mine", "--ca", "/secret/ca.pem")
    credential = tmp_path / "credential"
    credential.touch(0o600)
    credential.write_text(docker("exec", relay, *enrol))
    to = f"tls/localhost:{cloud.project.robots_port}"
    words = ("run", "--source", "demo", "--credential", str(credential), "--relay", to)
    stack.start("edge", str(BIN / "posecast-edge"), *words)
    until("it is on air", lambda: cloud.status("mine") == "online")
    docker("exec", relay, "posecast-relay", "robots", "remove", "mine")
    until("it is let go", lambda: cloud.status("mine") in ("offline", None))


def test_every_container_is_bound_hand_and_foot(cloud: Any) -> None:
    for service in SERVICES:
        (container,) = cloud.project.containers(service)
        found = cloud.project.inspect(container)
        host = found["HostConfig"]
        assert host["ReadonlyRootfs"], service
        assert host["CapDrop"] == ["ALL"], service
        added = [capability.removeprefix("CAP_") for capability in host["CapAdd"] or []]
        assert added == (["NET_BIND_SERVICE"] if service == "proxy" else []), service
        assert "no-new-privileges:true" in host["SecurityOpt"], service
        assert host["Memory"] > 0, service
        assert host["PidsLimit"] > 0, service
        user = docker("exec", container, "cat", "/proc/1/status")
        uid = next(line for line in user.splitlines() if line.startswith("Uid:")).split()[1]
        assert uid != "0", service
        with pytest.raises(AssertionError):
            docker("exec", container, "touch", "/etc/written")


def test_the_password_is_asked_for_and_shows_nowhere(cloud: Any) -> None:
    (relay,), (redis,) = cloud.project.containers("relay"), cloud.project.containers("redis")
    word = docker("exec", relay, "cat", "/secret/store").split(":")[2].partition("@")[0]
    assert len(word) > 30
    for container in (relay, redis):
        assert word not in docker("inspect", container)
        assert word not in docker("top", container, "-ww", "-eo", "pid,args")
        assert word not in docker("logs", container)
    assert "NOAUTH" in docker("exec", redis, "redis-cli", "ping")


@pytest.mark.parametrize("service", ["relay", "robots", "redis", "proxy"])
def test_a_killed_service_comes_back_by_itself(cloud: Any, service: str) -> None:
    (container,) = cloud.project.containers(service)
    before = cloud.project.inspect(container)["State"]["StartedAt"]
    os.kill(cloud.project.inspect(container)["State"]["Pid"], signal.SIGKILL)

    def back() -> bool:
        state = cloud.project.inspect(container)["State"]
        return bool(state["StartedAt"] != before and state["Health"]["Status"] == "healthy")

    until(f"{service} is healthy again", back, 60)
    cloud.until_moves()


def test_three_gateways_serve_one_robot(cloud: Any) -> None:
    many = {"RELAY_ROLE": "ingest", "VIEWERS_AT": "gateway", "GATEWAYS": "1"}
    words = ("--profile", "demo", "--profile", "gateways", "up", "--detach", "--wait")
    cloud.project.compose(*words, limit_s=180, **many)
    try:
        assert len(cloud.project.containers("gateway")) == 1
        # while it runs, and nobody but the gateways is started anew
        before = {s: cloud.project.containers(s) for s in SERVICES}
        cloud.project.compose(*words, "--scale", "gateway=3", limit_s=180, **many)
        assert {s: cloud.project.containers(s) for s in SERVICES} == before
        gateways = cloud.project.containers("gateway")
        assert len(gateways) == 3
        cloud.until_moves()

        async def watch() -> None:
            url = cloud.url.replace("https", "wss") + "/api/v1/robots/demo/live?hz=10"
            links = [await websockets.connect(url, ssl=cloud.trust, proxy=None) for _ in range(12)]
            try:
                frames = 0
                while frames < 12:
                    frames = 0
                    for link in links:
                        async with asyncio.timeout(20):
                            while not isinstance(await link.recv(), bytes):
                                pass
                            frames += 1
                shares = [viewers(gateway) for gateway in gateways]
                assert sum(shares) == 12, shares
                assert min(shares) > 0, shares
            finally:
                for link in links:
                    await link.close()

        asyncio.run(watch())
        # gateways only read the file of robots: the admin's page is the relay's all the same
        secret = carry_out(cloud, ADMIN, ROOT, **many).strip()
        link = ("posecast-relay", "robots", "set", "demo", "--link")
        docker("exec", *cloud.project.containers("relay"), *link, "view=public")
        until("the admin is let in", lambda: can_ask(cloud, secret))
        assert "#/r/demo?t=" in cloud.ask_admin(secret, "POST", "/robots/demo/links")["link"]
        docker("exec", *cloud.project.containers("relay"), *link, "nothing")
    finally:
        cloud.project.compose(*words[:2], "up", "--detach", "--wait", "--remove-orphans", limit_s=180)
        cloud.project.compose("--profile", "gateways", "rm", "--stop", "--force", "gateway")
    cloud.until_moves()


def can_ask(cloud: Any, secret: str) -> bool:
    try:
        cloud.ask_admin(secret)
    except OSError:
        return False
    return True


def test_the_lane_goes_through_a_cache(cloud: Any) -> None:
    def ask(path: str) -> Any:
        with urllib.request.urlopen(cloud.url + path, timeout=15, context=cloud.trust) as answer:
            answer.read()
            return answer.headers

    past = "/api/v1/robots/demo/past"
    assert ask(past)["x-cache"] is None, "without a cache the relay itself answers"
    words = ("--profile", "demo", "--profile", "cache", "up", "--detach", "--wait")
    try:
        cloud.project.compose(*words, limit_s=180, LANE_AT="cache")
        cloud.until_moves()
        until("there is a segment", lambda: cloud.get(past)["newest"])
        newest = cloud.get(past)["newest"]
        segment = f"{past}/public/{newest['take']}/{newest['index']}"
        assert [ask(segment)["x-cache"] for _ in range(2)] == ["MISS", "HIT"]
        assert ask("/api/v1/robots/demo")["x-cache"] is None
        (cache,) = cloud.project.containers("cache")
        host = cloud.project.inspect(cache)["HostConfig"]
        assert (host["ReadonlyRootfs"], host["CapDrop"]) == (True, ["ALL"])
    finally:
        cloud.project.compose(*words[:2], "up", "--detach", "--wait", limit_s=180)
        cloud.project.compose("--profile", "cache", "rm", "--stop", "--force", "cache")
    cloud.until_moves()


def viewers(container: str) -> int:
    """Of one process, as its metrics say."""
    ask = "import urllib.request as u; print(u.urlopen('http://127.0.0.1:9100/metrics').read().decode())"
    text = docker("exec", container, "python3", "-c", ask)
    (line,) = (line for line in text.splitlines() if line.startswith("posecast_viewers "))
    return int(float(line.split()[1]))


def test_prometheus_asks_the_relay_and_listens_here_only(cloud: Any) -> None:
    cloud.project.compose(
        "--profile", "observe", "up", "--detach", "--wait", "--no-deps", "prometheus", limit_s=180
    )
    try:
        (prometheus,) = cloud.project.containers("prometheus")

        def ask(query: str) -> list[Any]:
            url = "http://127.0.0.1:9090/api/v1/" + query
            found: list[Any] = json.loads(docker("exec", prometheus, "wget", "-q", "-O", "-", url))["data"]
            return found

        def is_asked() -> bool:
            found: Any = ask("query?query=posecast_viewers")
            return [each["metric"]["service"] for each in found["result"]] == ["relay"]

        until("the relay's metrics are there", is_asked, 60)
        groups: Any = ask("rules")
        alarms = [rule["name"] for group in groups["groups"] for rule in group["rules"]]
        assert "RelayDown" in alarms
        host = cloud.project.inspect(prometheus)["HostConfig"]
        assert (host["ReadonlyRootfs"], host["CapDrop"]) == (True, ["ALL"])
        at = cloud.project.inspect(prometheus)["NetworkSettings"]["Ports"]["9090/tcp"]
        assert {each["HostIp"] for each in at} == {"127.0.0.1"}
    finally:
        cloud.project.compose("--profile", "observe", "rm", "--stop", "--force", "--volumes", "prometheus")
