"""The page /admin: who may use it, from where, and what it does."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import pytest
from posecast_relay.config.robots_file import read_robots
from posecast_relay.http.admin.routes import AdminReport, MadeShareLink
from posecast_testing import free_port, until

from .command import run_command
from .stage import Relay, ZenohEdge

ROUTES = (("GET", ""), ("POST", "/robots/hubo/links"), ("DELETE", "/robots/hubo/links"))


class Lab:
    """A relay with a file of robots, and its admin's credential."""

    def __init__(self, folder: Path, relays: Callable[..., Relay], *flags: str) -> None:
        self.file = folder / "robots.toml"
        self.robots("add", "hubo")
        self.robots("set", "hubo", "--link", "view=public")
        self.robots("add", "private", "--private")
        self.secret = self.robots("admin").strip()
        self.relay = relays("--robots", str(self.file), "--metrics-port", "0", *flags)
        self.url = f"http://{self.relay.address}/api/v1/admin"

    def robots(self, *words: str) -> str:
        """`posecast-relay robots …`; what it prints."""
        done = run_command("robots", *words, "--robots", str(self.file))
        assert done.returncode == 0, done.stderr
        return done.stdout

    def ask(
        self, method: str = "GET", path: str = "", secret: str | None = None, **headers: str
    ) -> httpx.Response:
        """With the credential, unless another one is given."""
        shown = {"authorization": f"Bearer {self.secret if secret is None else secret}"}
        return httpx.request(method, self.url + path, headers=shown | headers)


@pytest.fixture
def lab(tmp_path: Path, relays: Callable[..., Relay]) -> Lab:
    """Started."""
    return Lab(tmp_path, relays)


@pytest.fixture(scope="module")
def still_lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """For tests after which others find it as it was."""
    folder = tmp_path_factory.mktemp("lab")
    lab = Lab(folder, partial(Relay, folder), "--public-url", "https://lab.example/robots")
    yield lab
    lab.relay.stop()
    assert "Traceback" not in lab.relay.errors()


def test_only_its_own_credential_opens_it(lab: Lab) -> None:
    hubo = read_robots(lab.file).enrolled["hubo"]
    link = lab.robots("link", "hubo").strip().partition("?t=")[2]
    for method, path in ROUTES:
        for secret in ("x", "x" * 43, hubo.secret or "", link, lab.secret[:-1]):
            answer = lab.ask(method, path, secret)
            assert (answer.status_code, answer.headers["cache-control"]) == (401, "no-store")
        assert httpx.request(method, lab.url + path).status_code == 401
        in_address = httpx.request(method, f"{lab.url}{path}?token={lab.secret}")
        assert in_address.status_code in (400, 401)
    assert lab.ask().status_code == 200
    lab.robots("admin")
    until("the old one is worth nothing", lambda: lab.ask().status_code == 401)
    assert lab.secret not in lab.relay.errors()


def test_no_page_of_another_origin_may_ask(still_lab: Lab) -> None:
    before = still_lab.file.read_text()
    for method, path in ROUTES:
        for origin in ("https://evil.example", "null", f"http://{still_lab.relay.address}.evil.example"):
            answer = still_lab.ask(method, path, origin=origin)
            assert answer.status_code == 403
            assert "set-cookie" not in answer.headers
    assert still_lab.file.read_text() == before
    assert still_lab.ask(origin=f"http://{still_lab.relay.address}").status_code == 200
    assert (
        "access-control-allow-origin" not in still_lab.ask(origin=f"http://{still_lab.relay.address}").headers
    )


def test_it_is_for_this_machine_unless_told_otherwise(tmp_path: Path, relays: Callable[..., Relay]) -> None:
    lab = Lab(tmp_path, relays, "--trusted-proxies", "127.0.0.0/8")
    page = f"http://{lab.relay.address}/admin/"
    far = {"x-forwarded-for": "10.1.2.3"}
    assert httpx.get(page).status_code == 200
    assert lab.ask(**far).status_code == httpx.get(page, headers=far).status_code == 403
    assert lab.ask(host="lab.evil.example").status_code == 403, "a name of theirs that leads here"
    lab.secret = lab.robots("admin", "--networks", "10.1.0.0/16", "fd00::/8").strip()
    until("the relay follows", lambda: lab.ask(**far).status_code == 200)
    assert lab.ask(**{"x-forwarded-for": "10.2.0.1"}).status_code == 403
    assert lab.ask(**{"x-forwarded-for": "fd00::1"}).status_code == 200
    assert lab.ask(**{"x-forwarded-for": "::ffff:10.1.2.3"}).status_code == 200
    headers = [("x-forwarded-for", "10.1.2.3"), ("x-forwarded-for", "10.2.0.1")]
    headers.append(("authorization", f"Bearer {lab.secret}"))
    assert httpx.get(lab.url, headers=headers).status_code == 403, "the first is the asker's own invention"
    lab.secret = lab.robots("admin", "--networks", "fd00::1/128").strip()
    until("the relay follows", lambda: lab.ask(**{"x-forwarded-for": "fd00::1"}).status_code == 200)
    assert lab.ask(**{"x-forwarded-for": "fd00::2"}).status_code == 403
    lab.secret = lab.robots("admin", "--networks").strip()
    until("the relay follows", lambda: lab.ask().status_code == 200)
    assert lab.ask(**far).status_code == 403


@contextmanager
def nginx_before(relay: str, folder: Path) -> Iterator[str]:
    """Start nginx with nothing but `proxy_pass`, and return its address."""
    address = f"127.0.0.1:{free_port()}"
    paths = [f"{kind}_temp_path {folder};" for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")]
    user = "" if os.getuid() else "user root;"  # nobody else may read a test's folder
    (folder / "nginx.conf").write_text(
        f"daemon off; pid {folder}/pid; error_log {folder}/error.log; events {{}} {user}"
        f"http {{ access_log off; {' '.join(paths)}"
        f" server {{ listen {address}; location / {{ proxy_pass http://{relay}; }} }} }}"
    )
    command = ["nginx", "-e", f"{folder}/error.log", "-c", f"{folder}/nginx.conf"]
    with subprocess.Popen(command) as process:
        try:
            until("nginx answers", lambda: _answers(address))
            yield address
        finally:
            process.terminate()


def _answers(address: str) -> bool:
    try:
        return httpx.get(f"http://{address}/livez").status_code == 200
    except httpx.TransportError:
        return False


@pytest.mark.skipif(shutil.which("nginx") is None, reason="no nginx here: apt-get install nginx")
def test_who_comes_through_nginx_as_it_is_by_default_is_not_this_machine(
    tmp_path: Path, relays: Callable[..., Relay], relay: Relay
) -> None:
    lab = Lab(tmp_path, relays)
    assert lab.ask().status_code == 200
    with nginx_before(lab.relay.address, tmp_path) as address:
        lab.url = f"http://{address}/api/v1/admin"
        assert lab.ask().status_code == httpx.get(f"http://{address}/admin/").status_code == 403
    with nginx_before(relay.address, tmp_path) as address:
        assert "publish_at" not in httpx.get(f"http://{address}/api/v1/robots").json()


def test_without_a_credential_in_the_file_there_is_no_page(lab: Lab, relay: Relay) -> None:
    text = lab.file.read_text()
    lab.file.write_text(text[: text.index("[admin]")])
    page = f"http://{lab.relay.address}/admin/"
    until("it is gone", lambda: lab.ask().status_code == 404)
    assert httpx.get(page).status_code == httpx.get(page.removesuffix("/")).status_code == 404
    assert httpx.get(f"{relay.base}/api/v1/admin").status_code == 404


def test_it_shows_robots_and_figures_and_no_secret(lab: Lab, edges: Callable[..., ZenohEdge]) -> None:
    edges(lab.relay.zenoh, robot="hubo")
    until("on air", lambda: lab.ask().json()["robots"][0]["status"] == "online")
    report: dict[str, Any] = lab.ask().json()
    assert AdminReport.model_validate(report, strict=True).robots[0].lateness_ms >= 0
    hubo, private = report["robots"]
    assert hubo["audiences"] == {"anyone": "public (30 min back)", "link": "public (no past)"}
    assert (hubo["robot"], hubo["conflict"], hubo["may_link"], hubo["has_links"]) == (
        "hubo",
        False,
        True,
        False,
    )
    assert (private["robot"], private["status"], private["audiences"]) == ("private", "offline", {})
    assert report["relay"]["trouble"] is None
    assert report["past"]["bytes_max"] == 256 << 20
    entries = read_robots(lab.file).enrolled.values()
    for secret in (*(entry.secret or "" for entry in entries), lab.secret):
        assert secret not in lab.ask().text


def test_a_view_that_the_robot_does_not_send_is_named(lab: Lab, edges: Callable[..., ZenohEdge]) -> None:
    def find_views() -> tuple[list[str] | None, dict[str, str] | None]:
        hubo = lab.ask().json()["robots"][0]
        return hubo.get("sent_views"), hubo.get("unsent_views")

    lab.robots("set", "hubo", "--link", "view=staff")
    assert find_views() == (None, None), "nobody knows before it is on air"
    edges(lab.relay.zenoh, robot="hubo")
    until("it is said", lambda: find_views() == (["public"], {"link": "staff"}))
    lab.robots("set", "hubo", "--link", "blackout=true")
    until("it shows nothing on purpose", lambda: find_views() == (["public"], {}))
    lab.robots("set", "hubo", "--link", "blackout=", "view=public")
    until("it is right", lambda: lab.ask().json()["robots"][0]["audiences"]["link"] == "public (no past)")
    assert find_views() == (["public"], {})


def test_share_links_are_made_and_revoked(lab: Lab, edges: Callable[..., ZenohEdge]) -> None:
    lab.robots("set", "hubo", "--anyone", "nothing")
    edges(lab.relay.zenoh, robot="hubo")
    made = lab.ask("POST", "/robots/hubo/links?days=3")
    assert made.status_code == 200
    MadeShareLink.model_validate(made.json(), strict=True)
    token = made.json()["link"].partition("?t=")[2]
    state = f"http://{lab.relay.address}/api/v1/robots/hubo/state"

    def see() -> int:
        return httpx.get(state, headers={"authorization": f"Bearer {token}"}).status_code

    until("the link is good", lambda: see() == 200)
    again = lab.ask("POST", "/robots/hubo/links").json()["link"]
    assert again != made.json()["link"]
    assert see() == 200, "another link leaves it as it is"
    assert lab.ask("DELETE", "/robots/hubo/links").status_code == 200
    until("it is good no more", lambda: see() == 401)
    for path, status, says in (
        ("/robots/none/links", 409, "no robot 'none'"),
        ("/robots/private/links", 409, "no [robots.private.link]"),
        ("/robots/*/links", 400, "robot '*'"),
        ("/robots/hubo/links?days=0", 400, "days: use"),
    ):
        answer = lab.ask("POST", path)
        assert (answer.status_code, says in answer.json()["error"]) == (status, True), answer.text
    assert token not in lab.relay.errors()


def test_the_api_describes_its_routes_and_what_they_answer(still_lab: Lab) -> None:
    paths = httpx.get(f"http://{still_lab.relay.address}/openapi.json").json()["paths"]
    told = {
        (method.upper(), path.removeprefix("/api/v1/admin")): route["responses"]
        for path, methods in paths.items()
        if path.startswith("/api/v1/admin")
        for method, route in methods.items()
    }
    assert told.keys() == {(method, path.replace("hubo", "{robot}")) for method, path in ROUTES}
    for (method, _), answers in told.items():
        assert answers.keys() >= {"200", "401", "403", "404"}
        assert ({"400", "409", "503"} <= answers.keys()) == (method != "GET")
        assert "422" not in answers
        assert answers["200"]["content"]["application/json"]["schema"]["$ref"]


def test_links_lead_to_where_people_open_the_page(still_lab: Lab) -> None:
    made = still_lab.ask("POST", "/robots/hubo/links").json()["link"]
    assert made.startswith("https://lab.example/robots/#/r/hubo?t=")


def test_the_page_has_a_policy_and_its_own_files_alone(still_lab: Lab) -> None:
    page = f"http://{still_lab.relay.address}/admin"
    assert httpx.get(page).headers["location"] == "admin/"
    assert '<link rel="icon" href="data:,">' in httpx.get(f"{page}/").text  # a browser asks for no other
    for name, kind in (("", "text/html"), ("admin.js", "javascript"), ("admin.css", "text/css")):
        answer = httpx.get(f"{page}/{name}")
        assert (answer.status_code, kind in answer.headers["content-type"]) == (200, True)
        policy = answer.headers["content-security-policy"]
        assert policy.startswith(
            "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
        )
        assert "frame-ancestors 'none'" in policy
        assert answer.headers["x-frame-options"] == "DENY"
        assert "set-cookie" not in answer.headers
    for name in ("routes.py", "../routes.py", "index.html", "%2e%2e/routes.py"):
        assert httpx.get(f"{page}/{name}").status_code == 404


def test_a_gateway_knows_of_robots_that_nobody_watches_there(
    tmp_path: Path, relays: Callable[..., Relay], edges: Callable[..., ZenohEdge], redis_server: Any
) -> None:
    lab = Lab(tmp_path, relays, "--store", redis_server.url)
    edges(lab.relay.zenoh, robot="hubo")
    gateway = relays("--role", "gateway", "--store", redis_server.url, "--robots", str(lab.file))
    lab.url = f"http://{gateway.address}/api/v1/admin"
    until(
        "it is on air", lambda: [row["status"] for row in lab.ask().json()["robots"]] == ["online", "offline"]
    )
    redis_server.kill()
    until("the page says so", lambda: "redis" in (lab.ask().json()["relay"]["trouble"] or ""))
    assert "redis" in httpx.get(f"http://{gateway.address}/readyz").json()["why"]
