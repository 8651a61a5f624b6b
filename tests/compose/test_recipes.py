"""The recipes for the containers in docs/how-to/, each run as written."""

from __future__ import annotations

import json
import shlex
import subprocess
import time
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import free_port, until

from tests.compose.engine import ROOT, docker
from tests.compose.recipes import (
    BACKUP,
    BUILD,
    GATEWAYS,
    GO_BACK,
    HEALTH,
    NOFILE,
    PAST_BACKUP,
    PAST_RESTORE,
    RELAY,
    REST,
    RESTORE,
    SECOND,
    adapt,
    attempt,
    carry_out,
    start_robot,
)
from tests.compose.test_compose import IMAGES, play
from tests.compose.watchers import HZ, PAGES, STALE_FRAMES, watch

pytestmark = pytest.mark.full

MANY = {"RELAY_ROLE": "ingest", "VIEWERS_AT": "gateway", "GATEWAYS": "3"}
MAY_MISS = STALE_FRAMES + 2 * HZ  # until a page has been STALE for 2 s


def test_three_gateways_are_upgraded_and_no_page_notices(cloud: Any, tmp_path: Path) -> None:
    up = ("--profile", "demo", "--profile", "gateways", "up", "--detach", "--wait")
    cloud.project.compose(*up, limit_s=240, **MANY)
    try:
        cloud.until_moves()
        before = set(cloud.project.containers("gateway"))
        assert len(before) == 3
        with watch(cloud, tmp_path) as pages:
            found = play(
                cloud,
                "upgrade",
                POSECAST_UPGRADE=adapt(cloud, GATEWAYS, ROOT, **MANY),
                POSECAST_MAY_MISS=str(STALE_FRAMES - 1),
            )
        assert found == {"passed": 1}
        assert pages.count_moves() >= PAGES
        assert pages.list_lost_by_moves() == []
        assert pages.list_repeated() == []
        after = set(cloud.project.containers("gateway"))
        assert len(after) == 3
        assert not after & before
    finally:
        cloud.project.compose(*up[:2], "up", "--detach", "--wait", "--remove-orphans", limit_s=240)
        cloud.project.compose("--profile", "gateways", "rm", "--stop", "--force", "gateway")
    cloud.until_moves()


def test_one_relay_is_upgraded_and_pages_are_stale_for_two_seconds_at_most(
    cloud: Any, stack: Any, tmp_path: Path
) -> None:
    (before,) = cloud.project.containers("relay")
    robot = start_robot(cloud, stack, "outside", tmp_path / "outside.credential")
    script = adapt(cloud, RELAY)
    with watch(cloud, tmp_path) as pages:
        found = play(cloud, "upgrade", POSECAST_UPGRADE=script, POSECAST_MAY_MISS=str(MAY_MISS))
    assert found == {"passed": 1}
    assert pages.count_moves() >= PAGES
    print(f"STALE for {pages.measure_longest_s():.1f} s at most, {pages.count_missed()} frames missed")
    assert pages.count_missed() <= MAY_MISS
    assert pages.list_repeated() == []
    (after,) = cloud.project.containers("relay")
    assert after != before
    until("a robot from outside has followed", lambda: cloud.status("outside") == "online")
    assert robot.process.poll() is None
    carry_out(cloud, REST)
    assert cloud.project.containers("relay") == [after], "it is not replaced once more"
    docker("exec", after, "posecast-relay", "robots", "remove", "outside")


def test_what_was_backed_up_comes_back_with_the_credentials(
    cloud: Any, stack: Any, tmp_path: Path, record_testsuite_property: Any
) -> None:
    start_robot(cloud, stack, "kept", tmp_path / "kept.credential")
    kept = tmp_path / "posecast.tar.gz"
    carry_out(cloud, BACKUP.replace("> posecast.tar.gz", f"> {kept}"))
    assert kept.stat().st_mode & 0o777 == 0o600
    root = docker("exec", cloud.project.containers("proxy")[0], "cat", ROOT_CERTIFICATE)
    write_volume(cloud, "past", "past/stays", "here")
    before = set(cloud.project.containers("proxy")) | set(cloud.project.containers("relay"))
    torn = tmp_path / "torn.tar.gz"
    torn.write_bytes(kept.read_bytes()[:-100])
    assert attempt(cloud, RESTORE.replace("posecast.tar.gz", str(torn))).returncode
    assert before == set(cloud.project.containers("proxy")) | set(cloud.project.containers("relay"))
    began_s = time.monotonic()
    carry_out(cloud, RESTORE.replace("posecast.tar.gz", str(kept)))
    restored_s = time.monotonic() - began_s
    assert docker("exec", cloud.project.containers("proxy")[0], "cat", ROOT_CERTIFICATE) == root
    until("the robot is back with its old credential", lambda: cloud.status("kept") == "online", 30)
    assert read_volume(cloud, "past", "past/stays") == "here", "what is in no backup is left alone"
    print(f"restored in {restored_s:.1f} s, the robot back after {time.monotonic() - began_s:.1f} s")
    record_testsuite_property("restored_s", round(restored_s, 1))
    cloud.project.compose("--profile", "demo", "up", "--detach", "--wait", limit_s=180)
    cloud.until_moves()


ROOT_CERTIFICATE = "/caddy/data/caddy/pki/authorities/local/root.crt"


class Stay(urllib.request.HTTPRedirectHandler):
    """A redirect is an answer."""

    def redirect_request(self, *_: Any) -> None:
        """Not followed."""


def test_a_second_lab_stands_beside_the_first_on_ports_of_its_own(cloud: Any, tmp_path: Path) -> None:
    https, http, robots = free_port(), free_port(), free_port()
    env = tmp_path / "second.env"
    block = SECOND
    for shown, mine in {
        "infra/second.env": str(env),
        "HTTPS_PORT=8443": f"HTTPS_PORT={https}",
        "HTTP_PORT=8081": f"HTTP_PORT={http}",
        "ROBOTS_PORT=8447": f"ROBOTS_PORT={robots}\nNOFILE={cloud.project.settings['NOFILE']}",
        "lab=second": f"lab={cloud.project.name}-second",
        "docker compose": shlex.join(cloud.project.program),
    }.items():
        assert shown in block
        block = block.replace(shown, mine)
    begin, _, up = block.strip().rpartition("\n")
    assert up.startswith("compose up")
    down = f"cd {ROOT}\n{begin}\ncompose down --volumes --timeout 5"
    try:
        done = subprocess.run(
            ["bash", "-euc", f"cd {ROOT}\n{block}"],
            capture_output=True,
            text=True,
            check=False,
            timeout=240,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        opener = urllib.request.build_opener(Stay)
        for port, goes_to in ((http, https), (cloud.project.http_port, cloud.project.https_port)):
            with pytest.raises(urllib.error.HTTPError) as sent:
                opener.open(f"http://localhost:{port}/r/demo?x=1", timeout=10)
            assert (sent.value.code, sent.value.headers["location"]) == (
                308,
                f"https://localhost:{goes_to}/r/demo?x=1",
            )
        cloud.until_moves()
    finally:
        subprocess.run(["bash", "-euc", down], check=True, capture_output=True, timeout=180)


def test_a_host_that_allows_fewer_open_files(cloud: Any) -> None:
    allowed = int(carry_out(cloud, NOFILE))
    assert allowed >= 1024
    fewer = str(min(allowed, 4096))
    settings = {"NOFILE": fewer, "MAX_VIEWERS": str(int(fewer) - 2000)}
    try:
        cloud.project.compose("up", "--detach", "--wait", limit_s=180, **settings)
        (relay,) = cloud.project.containers("relay")
        assert docker("exec", relay, "sh", "-c", "ulimit -Hn").strip() == fewer
        assert "open files" not in docker("logs", relay)
        cloud.until_moves()
    finally:
        cloud.project.compose("--profile", "demo", "up", "--detach", "--wait", limit_s=180)
    cloud.until_moves()


def test_the_images_are_made_while_the_old_ones_run_and_one_can_go_back(cloud: Any) -> None:
    services = {"relay": "posecast", "proxy": "posecast-proxy"}
    before = {service: cloud.project.containers(service) for service in services}
    carry_out(cloud, BUILD)
    assert {service: cloud.project.containers(service) for service in services} == before
    assert {"posecast", "posecast-proxy"} <= set(IMAGES)
    for image in services.values():
        docker("tag", "redis:7", image)  # a bad version
    carry_out(cloud, GO_BACK)
    for service, image in services.items():
        (container,) = before[service]
        (made,) = json.loads(docker("image", "inspect", image))
        assert made["Id"] == cloud.project.inspect(container)["Image"]


def test_a_successor_that_is_not_ready_goes_and_the_old_relay_serves_on(cloud: Any) -> None:
    before = cloud.project.containers("relay", running=False)
    stopped = attempt(cloud, RELAY, MAX_VIEWERS="many")
    assert stopped.returncode != 0
    assert "the old one serves on" in stopped.stderr
    assert "POSECAST_MAX_VIEWERS" in stopped.stdout + stopped.stderr, "what it said is shown"
    assert cloud.project.containers("relay", running=False) == before
    cloud.until_moves()


def test_a_relay_starts_while_redis_does_not_answer(cloud: Any) -> None:
    (redis,) = cloud.project.containers("redis")
    docker("kill", "--signal", "STOP", redis)
    try:
        until(
            "the engine has seen it",
            lambda: cloud.project.inspect(redis)["State"]["Health"]["Status"] == "unhealthy",
            60,
        )
        cloud.project.compose("up", "--detach", "--force-recreate", "relay", limit_s=180)
        cloud.until_moves()
        until("it says so", lambda: "degraded" in carry_out(cloud, HEALTH), 30)
    finally:
        docker("kill", "--signal", "CONT", redis)
    until("all is well again", lambda: '"ready"' in carry_out(cloud, HEALTH), 60)


def write_volume(cloud: Any, volume: str, path: str, text: str) -> None:
    """A file in a volume of the cloud; `path` begins with the volume's name."""
    folder = f"mkdir -p $(dirname /{path}) && printf %s {text} > /{path}"
    mount = f"{cloud.project.name}_{volume}:/{volume}"
    docker("run", "--rm", "--network", "none", "--volume", mount, "posecast", "sh", "-c", folder)


def read_volume(cloud: Any, volume: str, path: str) -> str:
    """The content of that file. AssertionError if it is missing."""
    mount = f"{cloud.project.name}_{volume}:/{volume}:ro"
    return docker("run", "--rm", "--network", "none", "--volume", mount, "posecast", "cat", f"/{path}")


def test_the_past_comes_back_and_the_file_of_robots_stays(cloud: Any, tmp_path: Path) -> None:
    kept = tmp_path / "past.tar.gz"
    write_volume(cloud, "past", "past/hubo/one.segment", "recorded")
    carry_out(cloud, PAST_BACKUP.replace("> past.tar.gz", f"> {kept}"))
    assert kept.stat().st_mode & 0o777 == 0o600
    write_volume(cloud, "past", "past/hubo/one.segment", "lost")
    (relay,) = cloud.project.containers("relay")
    docker("exec", relay, "posecast-relay", "robots", "add", "later", "--ca", "/secret/ca.pem")
    restore = PAST_RESTORE.replace("past.tar.gz", str(kept))
    carry_out(cloud, restore)
    assert read_volume(cloud, "past", "past/hubo/one.segment") == "recorded"
    (relay,) = cloud.project.containers("relay")
    docker("exec", relay, "posecast-relay", "robots", "remove", "later")
    write_volume(cloud, "past", "past/tombstones/hubo/one.done", "")
    carry_out(cloud, restore)
    done = f"{cloud.project.name}_past:/past:ro"
    found = docker(
        "run", "--rm", "--network", "none", "--volume", done, "posecast", "find", "/past", "-name", "*.done"
    )
    assert found == ""
    cloud.until_moves()
