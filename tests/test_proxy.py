"""The shipped proxy (infra/Caddyfile) in front of a real relay, in its own network namespace."""

from __future__ import annotations

import json
import os
import re
import shutil
import socket
import ssl
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from email.message import Message
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import Process, until

from tests.conftest import BIN, Stack
from tests.namespaces import Namespace

ROOT = Path(__file__).resolve().parent.parent
CADDY = BIN / "caddy"
NGINX = shutil.which("nginx")
SLOW = 400
PER_ADDRESS = 3
UNREAD_S = 3  # instead of the two minutes that the file says
SAFE = (
    *("x-frame-options", "x-content-type-options", "referrer-policy"),
    *("cross-origin-opener-policy", "permissions-policy"),
)
EMBEDDER, RESOURCE = "cross-origin-embedder-policy", "cross-origin-resource-policy"
OTHERS = "10.9.9."  # addresses that are not this machine's own, which are not counted
PUBLISHED = "10.9.8.7"  # in SITE, like the host's address, which a container does not have
PUBLISHED_6 = "fd00::5"

pytestmark = pytest.mark.skipif(not CADDY.exists(), reason="no caddy in the virtual environment")


class Stay(urllib.request.HTTPRedirectHandler):
    """A redirect is an answer."""

    def redirect_request(self, *_: Any) -> None:
        """Not followed."""


@dataclass
class Site:
    """Clients are in the namespace too."""

    place: Namespace
    trust: ssl.SSLContext
    proxy: int  # its process
    stack: Stack
    cache: Process | None
    cache_command: tuple[str, ...]

    def get(self, path: str, **headers: str) -> tuple[int, Message[str, str], bytes]:
        """Status, headers, body of a GET; of `http://…` or of a path behind TLS."""
        url = path if "://" in path else f"https://localhost{path}"

        def ask() -> tuple[int, Message[str, str], bytes]:
            opener = urllib.request.build_opener(urllib.request.HTTPSHandler(context=self.trust), Stay)
            try:
                with opener.open(urllib.request.Request(url, headers=headers), timeout=10) as answer:
                    return answer.status, answer.headers, answer.read()
            except urllib.error.HTTPError as e:
                return e.code, e.headers, e.read()

        found: tuple[int, Message[str, str], bytes] = self.place.run(ask)
        return found


def set_up_cache(folder: Path) -> tuple[str, ...]:
    """The command that starts nginx as the Compose file's cache."""
    text = (ROOT / "infra/cache.conf").read_text()
    for old, new in {
        "/tmp/": f"{folder}/",
        "listen 8080": "listen 127.0.0.1:8090",
        "http://relay:8080": "http://127.0.0.1:8080",
        "/etc/nginx/nginx-lane.rules": f"{ROOT}/infra/hosting/nginx-lane.rules",
    }.items():
        assert old in text, old
        text = text.replace(old, new)
    (folder / "cache.conf").write_text(text)
    user = "" if os.getuid() else "user root;"  # nobody else may read a test's folder
    return "nginx", "-c", str(folder / "cache.conf"), "-g", f"daemon off; {user}"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """A relay, its demo robot and the proxy in front of them, for all tests in this file."""
    folder = tmp_path_factory.mktemp("proxy")
    place, stack = Namespace(), Stack(folder)
    place.do("ip link set lo up", *(f"ip address add {OTHERS}{n}/32 dev lo" for n in (1, 2, 3)))
    page = str(ROOT / "spa/dist")
    caddyfile = folder / "Caddyfile"
    text = (ROOT / "infra/Caddyfile").read_text()
    assert text.count("write_idle 2m") == 1
    caddyfile.write_text(text.replace("write_idle 2m", f"write_idle {UNREAD_S}s"))
    settings = {
        "PATH": f"{BIN}:{os.environ['PATH']}",
        "SITE": f"localhost, {PUBLISHED}, [{PUBLISHED_6}]",
        "VIEWERS_AT": "127.0.0.1",
        "ADMIN_AT": "127.0.0.1",
        "LANE_AT": "127.0.0.1" if NGINX else "",
        "LANE_PORT": "8090",
        "PAGE": page,
        "XDG_DATA_HOME": str(folder),
        "XDG_CONFIG_HOME": str(folder),
    }
    words = [f"{name}={value}" for name, value in settings.items()]
    caddy = [str(ROOT / "infra/start_proxy.sh"), "--config", str(caddyfile), "--adapter", "caddyfile"]
    root = folder / "caddy/pki/authorities/local/root.crt"
    try:
        limits = ("--trusted-proxies", "127.0.0.1", "--max-per-address", str(PER_ADDRESS), "--static", page)
        relay = place.run(lambda: stack.relay(port=8080, zenoh_port=7447, flags=limits))
        place.run(lambda: stack.edge(relay[2], "--source", "demo"))
        proxy = place.run(lambda: stack.start("proxy", "env", *words, *caddy))
        command = set_up_cache(folder)
        cache = place.run(lambda: stack.start("cache", *command)) if NGINX else None

        def authority() -> bool:
            assert proxy.process.poll() is None, proxy.log
            return root.is_file()

        until("the proxy has made its authority", authority, 60)
        trust = ssl.create_default_context(cafile=str(root))
        made = Site(place, trust, proxy.process.pid, stack, cache, command)

        def serves() -> bool:
            try:
                return made.get("/api/v1/robots/demo/state")[0] == 200
            except OSError:  # also while its certificate is being made
                return False

        # a certificate that could not be made at once is tried again by Caddy after a minute
        until("the robot is on air behind the proxy", serves, 120)
        yield made
    finally:
        for part in reversed(stack.parts):
            part.stop()
            print(part.log[-3000:])
        place.close()


def wait_for_segment(site: Site, past: str) -> str:
    """The address of the newest segment, as soon as there is one."""
    newest: dict[str, Any] = {}

    def is_there() -> bool:
        status, _, body = site.get(past)
        newest.update((json.loads(body).get("newest") or {}) if status == 200 else {})
        return bool(newest)

    until("there is a segment", is_there)
    return f"{past}/public/{newest['take']}/{newest['index']}"


@pytest.mark.skipif(NGINX is None, reason="no nginx here: apt-get install nginx")
def test_only_the_lane_goes_through_the_cache(site: Site) -> None:
    past = "/api/v1/robots/demo/past"
    segment = wait_for_segment(site, past)
    itself = site.get(f"http://127.0.0.1:8080{segment}")
    for kept in ("MISS", "HIT"):
        status, headers, body = site.get(segment)
        assert (status, headers["x-cache"], body) == (200, kept, itself[2])
        for name in ("cache-control", "etag", "access-control-allow-origin", "x-content-type-options"):
            assert headers.get_all(name) is not None
            assert len(headers.get_all(name) or []) == 1, name
    assert site.get(segment, authorization="Bearer x")[1]["x-cache"] == "BYPASS"
    # as docs/how-to/scale/cache-for-a-crowd.md empties it
    kept_at = Path(site.cache_command[2]).parent / "posecast"
    subprocess.run(["find", kept_at, "-type", "f", "-delete"], check=True)
    assert [site.get(segment)[1]["x-cache"] for _ in range(2)] == ["MISS", "HIT"]
    for path in ("/api/v1/robots/demo", "/api/v1/robots", "/"):
        assert site.get(path)[1]["x-cache"] is None, path


@pytest.mark.skipif(NGINX is None, reason="no nginx here: apt-get install nginx")
def test_without_its_cache_the_lane_comes_from_the_relay(site: Site) -> None:
    past = "/api/v1/robots/demo/past"
    segment = wait_for_segment(site, past)
    assert site.get(segment)[1]["x-cache"] is not None
    assert site.cache is not None
    site.cache.stop()
    try:
        status, headers, body = site.get(segment)
        itself = site.get(f"http://127.0.0.1:8080{segment}")
        assert (status, headers["x-cache"], body) == (200, None, itself[2])
        for name in ("cache-control", "etag", "access-control-allow-origin", "x-content-type-options"):
            assert headers.get_all(name) == itself[1].get_all(name), name
        assert site.get("/api/v1/robots/demo/past/public/0000000000000000/0")[0] == 404
    finally:
        site.cache = site.place.run(lambda: site.stack.start("cache", *site.cache_command))
    until("the cache is asked again", lambda: site.get(segment)[1]["x-cache"] is not None)


def test_page_and_routes_over_tls(site: Site) -> None:
    status, headers, body = site.get("/")
    assert (status, headers["cache-control"]) == (200, "no-cache")
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["server"] is None
    assert headers["alt-svc"] is None  # no other port is open
    itself = site.get("http://127.0.0.1:8080/")[1]  # as the relay sends the same page
    for name in SAFE:
        assert headers[name] == itself[name] is not None, name
    asset = re.findall(r"\./(assets/[^\"]+\.js)", body.decode())[0]
    for accepts, encoding in (("gzip", "gzip"), ("gzip, deflate, br", "br"), ("br;q=0, gzip", "gzip")):
        status, headers, _ = site.get(f"/{asset}", **{"accept-encoding": accepts})
        assert (status, headers["content-encoding"]) == (200, encoding)
        assert "accept-encoding" in headers["vary"].lower()
    assert headers["cache-control"] == "public, max-age=31536000, immutable"
    for path, readers in ((f"/{asset}", "*"), ("/config.json", "*"), ("/", None), ("/favicon.svg", None)):
        for at in ("", "http://127.0.0.1:8080"):  # the relay too
            headers = site.get(at + path)[1]
            assert headers["access-control-allow-origin"] == readers, at + path
            isolated = ("require-corp", "cross-origin") if path == f"/{asset}" else (None, None)
            assert (headers[EMBEDDER], headers[RESOURCE]) == isolated, at + path
    assert site.get("/.vite/manifest.json")[0] == 404
    status, headers, _ = site.get("/assets/gone.js")
    assert (status, headers.get_all("cache-control")) == (404, ["no-store"])
    assert "/api/v1/robots" in json.loads(site.get("/openapi.json")[2])["paths"]
    for framed in ("/embed/demo", "/embed/"):  # as the relay says it, and nobody else
        status, headers, _ = site.get(framed)
        policies = headers.get_all("content-security-policy") or []
        assert (status, [each.split("; ")[-1] for each in policies]) == (200, ["frame-ancestors *"])
        assert headers["x-frame-options"] is None
        assert (headers[EMBEDDER], headers[RESOURCE]) == ("require-corp", "cross-origin"), framed
    for inside in ("/livez", "/readyz", "/metrics"):
        assert site.get(inside)[0] == 404, inside
    # under a robot's name, and where somebody has mistyped one, it is the relay's page
    for path, is_page, status in (("/r/demo", True, 200), ("/demo", True, 404), ("/favicon.svg", False, 200)):
        found, headers, body = site.get(path, accept="text/html")
        assert (found, b"data-home" in body) == (status, is_page), path
        assert len(headers.get_all("x-content-type-options") or []) == 1, path
    status, headers, _ = site.get("http://localhost/")
    assert (status, headers["location"]) == (308, "https://localhost/")
    assert site.get("/", **{"x-long": "x" * 40_000})[0] == 431


def test_the_page_opens_by_the_address_in_site(site: Site) -> None:
    """Clients that open an IP address send no SNI."""
    for host in (PUBLISHED, f"[{PUBLISHED_6}]"):
        answer = site.place.run(partial(ask_by_address, site, host))
        assert answer.startswith(b"HTTP/1.1 200 "), host
        assert b'id="root"' in answer
        status, headers, _ = site.get(f"http://{OTHERS}1/a?b", host=host)
        assert (status, headers["location"]) == (308, f"https://{host}/a?b")


def ask_by_address(site: Site, host: str) -> bytes:
    """The answer over TLS, to a client that opened an address."""
    raw = socket.create_connection((f"{OTHERS}1", 443), 10)
    # for an address, Python sends no SNI, and expects it in the certificate
    with site.trust.wrap_socket(raw, server_hostname=PUBLISHED) as link:
        link.sendall(f"GET / HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n".encode())
        return link.makefile("rb").read()


@pytest.mark.parametrize("host", [f"{OTHERS}1", "[fd00::7]", "lab.test:8443"])
def test_who_opens_another_address_is_told_so(site: Site, host: str) -> None:
    told = "This address is not in SITE. "
    head, _, said = site.place.run(lambda: ask_by_address(site, host)).decode().partition("\r\n\r\n")
    assert head.startswith("HTTP/1.1 421 ")
    assert "\nServer:" not in head
    assert said.startswith(told)
    status, headers, body = site.get(f"http://{OTHERS}1/", host=host)
    assert (status, headers["location"], headers["server"]) == (421, None, None)
    assert body.decode().startswith(told)


@pytest.mark.parametrize(
    ("site", "default", "names"),
    [
        ("lab.test, 10.0.0.5, 10.0.0.6", "10.0.0.5", "lab.test 10.0.0.5 10.0.0.6"),
        ("https://10.0.0.5:8443", "10.0.0.5", "10.0.0.5"),
        ("lab.test:8443,[fd00::5]:8443", "fd00::5", "lab.test fd00::5"),
        ("fd00::5", "fd00::5", "fd00::5"),
        ("lab.test", "localhost", "lab.test"),
    ],
)
def test_who_opens_an_address_gets_the_certificate_of_the_first_one_in_site(
    site: str, default: str, names: str
) -> None:
    script = ROOT / "infra/start_proxy.sh"
    text = script.read_text()
    assert "exec caddy run" in text
    shown = text.replace("exec caddy run", 'echo "$DEFAULT_SNI, $NAMES"; exit')
    done = subprocess.run(
        ["sh", "-c", shown, script],
        env=os.environ | {"SITE": site},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    assert done.stdout == f"{default}, {names} \n"


def test_who_never_reads_its_answer_is_let_go(site: Site) -> None:
    longest = max((ROOT / "spa/dist/assets").iterdir(), key=lambda file: file.stat().st_size)

    def ask() -> ssl.SSLSocket:
        raw = socket.socket()
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        raw.connect(("127.0.0.1", 443))
        link = site.trust.wrap_socket(raw, server_hostname="localhost")
        # more than all buffers of a loopback take
        link.sendall(100 * f"GET /assets/{longest.name} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        return link

    def held() -> int:
        """Connections that the proxy has open towards viewers."""
        port_443, established = ":01BB", "01"
        text = "".join(Path(f"/proc/{site.proxy}/net/{table}").read_text() for table in ("tcp", "tcp6"))
        lines = [line.split() for line in text.splitlines()]
        return sum(line[1].endswith(port_443) and line[3] == established for line in lines)

    until("nobody else is there", lambda: held() == 0, 30)
    links = [site.place.run(ask) for _ in range(5)]
    try:
        assert held() == len(links)
        until("they are let go", lambda: held() == 0, 60)
    finally:
        for link in links:
            link.close()


def test_events_pass_as_they_come(site: Site) -> None:

    def read() -> int:
        url = "https://localhost/api/v1/robots/demo/live.sse?hz=10"
        with urllib.request.urlopen(url, timeout=10, context=site.trust) as answer:
            events = 0
            while events < 20:
                events += answer.readline().startswith(b"data:")
            return events

    assert site.place.run(read) == 20


def test_viewers_are_told_apart_behind_the_proxy(site: Site) -> None:
    links = []

    def stream(address: str) -> str:
        """The first event of one more stream from that address, which claims another address."""
        raw = socket.create_connection((f"{OTHERS}1", 443), 10, source_address=(address, 0))
        link = site.trust.wrap_socket(raw, server_hostname="localhost")
        links.append(link)
        wanted = "/api/v1/robots/demo/live.sse?hz=1"
        asked = f"GET {wanted} HTTP/1.1\r\nHost: localhost\r\nX-Forwarded-For: 10.9.9.9\r\n\r\n"
        link.sendall(asked.encode())
        answer = link.makefile("r", encoding="utf-8", newline="\n")
        return next(line for line in answer if line.startswith("event: ")).split()[1]

    def all_of_them() -> list[str]:
        return [stream(f"{OTHERS}{n}") for n in (2, 2, 2, 2, 3)]

    try:
        # the fourth of one address is told the lane
        assert site.place.run(all_of_them) == ["hello", "hello", "hello", "bye", "hello"]
    finally:
        for link in links:
            link.close()


def test_who_sends_its_request_drop_by_drop_keeps_nobody_waiting(site: Site) -> None:
    def open_all() -> list[socket.socket]:
        sockets = []
        for i in range(SLOW):
            link = socket.create_connection(("127.0.0.1", 80 if i % 2 else 443), 10)
            link.send(b"GET / HTTP/1.1\r\nX-Slow: " if i % 2 else b"\x16\x03\x01\x02\x00")
            link.setblocking(False)
            sockets.append(link)
        return sockets

    sockets = site.place.run(open_all)
    waits = []
    for _ in range(10):
        began_s = time.monotonic()
        assert site.get("/api/v1/robots")[0] == 200
        waits.append(time.monotonic() - began_s)
    print(f"with {SLOW} slow requests open: the slowest of ten answers took {max(waits) * 1e3:.0f} ms")
    open_now = set(sockets)

    def all_closed() -> bool:
        for link in list(open_now):
            try:
                while link.recv(4096):
                    pass
                open_now.remove(link)
            except BlockingIOError:
                pass
            except OSError:
                open_now.remove(link)
        return not open_now

    until("the slow ones are let go", all_closed, 60)
    for link in sockets:
        link.close()
