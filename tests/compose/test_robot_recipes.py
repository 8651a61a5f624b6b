"""The recipes for robots and the admin page in containers, each run as written in
docs/how-to/operate/container-recipes.md."""

from __future__ import annotations

import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import until

from tests.compose.engine import docker
from tests.compose.recipes import (
    ADD,
    ADMIN,
    BACK,
    BEGIN,
    EDIT,
    FINISH,
    LINK,
    RULES,
    attempt,
    carry_out,
    start_robot,
)

pytestmark = pytest.mark.full


@pytest.fixture
def relay(cloud: Any) -> Iterator[str]:
    """The relay's container, from which `hubo` is removed afterwards."""
    (found,) = cloud.project.containers("relay")
    yield found
    docker("exec", found, "posecast-relay", "robots", "remove", "hubo")


def test_a_robot_is_added_and_seen_as_the_admin_says(
    cloud: Any, relay: str, stack: Any, tmp_path: Path
) -> None:
    def read_file() -> str:
        return docker("exec", relay, "cat", "/robots/robots.toml")

    carry_out(cloud, ADD, tmp_path)
    credential = tmp_path / "hubo.credential"
    assert credential.stat().st_mode & 0o777 == 0o600
    start_robot(cloud, stack, "hubo", credential)

    listed = carry_out(cloud, RULES, tmp_path)
    (line,) = (line for line in listed.splitlines() if line.startswith("hubo\t"))
    assert "10 s late" in line
    assert "link: " in line
    assert "https://localhost/#/r/hubo?t=" in carry_out(cloud, LINK, tmp_path)

    before, copy = read_file(), tmp_path / "robots.toml"
    wrong = attempt(cloud, f"EDITOR='sed -i s/delay_s/delays/'\n{EDIT}", tmp_path)
    assert "delays" in wrong.stderr
    assert read_file() == before
    assert "delays" in copy.read_text(), "what was written is still there, to be corrected"
    carry_out(cloud, f"EDITOR='sed -i s/delay_s.=.10/delay_s=3/'\n{EDIT}", tmp_path)
    assert read_file() == before.replace("delay_s = 10", "delay_s=3") != before
    assert not copy.exists()
    carry_out(cloud, BACK, tmp_path)
    assert read_file() == before
    assert docker("exec", relay, "stat", "-c", "%u %a", "/robots/robots.toml").split() == ["10001", "600"]


def test_a_credential_is_changed_while_the_robot_runs(
    cloud: Any, relay: str, stack: Any, tmp_path: Path
) -> None:
    carry_out(cloud, ADD, tmp_path)
    credential, old = tmp_path / "hubo.credential", tmp_path / "old.credential"
    robot = start_robot(cloud, stack, "hubo", credential)
    old.write_bytes(credential.read_bytes())
    old.chmod(0o600)
    carry_out(cloud, BEGIN, tmp_path)
    (tmp_path / "hubo.new").rename(credential)
    until("the agent has tried it", lambda: "does not accept the new credential yet" in robot.log, 60)
    assert cloud.status("hubo") == "online"
    carry_out(cloud, FINISH, tmp_path)
    until("the agent is in by it", lambda: "the new credential is in use" in robot.log, 60)
    until("it is on air", lambda: cloud.status("hubo") == "online")
    robot.stop()
    until("it has gone", lambda: cloud.status("hubo") in ("offline", None))
    words = ("--credential", str(old), "--relay", f"tls/localhost:{cloud.project.robots_port}")
    late = stack.start("late", robot.process.args[0], "run", "--source", "demo", *words)
    until("the old one is refused", lambda: "refuses 'hubo'" in late.log, 60)


def find_status(cloud: Any, secret: str) -> int:
    try:
        cloud.ask_admin(secret)
    except urllib.error.HTTPError as e:
        return e.code
    return 200


def test_the_admin_opens_the_page_from_this_machine(cloud: Any, relay: str, tmp_path: Path) -> None:
    carry_out(cloud, ADD, tmp_path)
    carry_out(cloud, RULES, tmp_path)
    nowhere = docker("exec", relay, "posecast-relay", "robots", "admin", "--networks").strip()
    until("nobody may ask", lambda: find_status(cloud, nowhere) == 403)
    secret = carry_out(cloud, ADMIN, tmp_path).strip()
    until("this machine may", lambda: find_status(cloud, secret) == 200)
    assert find_status(cloud, nowhere) == 401
    with urllib.request.urlopen(f"{cloud.url}/admin", timeout=10, context=cloud.trust) as page:
        assert "admin.js" in page.read().decode()
    assert {"demo", "hubo"} <= {robot["robot"] for robot in cloud.ask_admin(secret)["robots"]}
    assert "#/r/hubo?t=" in cloud.ask_admin(secret, "POST", "/robots/hubo/links")["link"]
    assert ask_neighbour(cloud, secret) == "403"


def ask_neighbour(cloud: Any, secret: str) -> str:
    """The status for a client that reaches the proxy from another address than this machine's."""
    asks = (
        "import http.client, ssl, socket\n"
        "context = ssl._create_unverified_context()\n"
        "link = http.client.HTTPConnection('localhost')\n"
        "plain = socket.create_connection(('proxy', 443), 5)\n"
        "link.sock = context.wrap_socket(plain, server_hostname='localhost')\n"
        f"link.request('GET', '/api/v1/admin', headers={{'authorization': 'Bearer {secret}'}})\n"
        "print(link.getresponse().status)\n"
    )
    network = f"{cloud.project.name}_web"
    return docker("run", "--rm", "--network", network, "posecast", "python3", "-c", asks).strip()
