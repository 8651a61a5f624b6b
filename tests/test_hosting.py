"""The page on other web servers: real nginx, alone and in front of a relay."""

from __future__ import annotations

import asyncio
import gzip
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
from collections import Counter
from collections.abc import Callable
from email.message import Message
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import free_port, until

from tests.conftest import Stack
from tests.doc_blocks.block import read_blocks
from tests.lane import Link

ROOT = Path(__file__).resolve().parent.parent
HOSTING = ROOT / "infra/hosting"
EMBEDDER, RESOURCE = "cross-origin-embedder-policy", "cross-origin-resource-policy"
DIST = ROOT / "spa/dist"
POLICY = re.compile(r'http-equiv="Content-Security-Policy"\s+content="([^"]+)"')
HALL = 40  # people: a 25th of those that the limits are for, and here so are the limits
FILES_OF_A_LOAD = 50

pytestmark = [
    pytest.mark.skipif(shutil.which("nginx") is None, reason="no nginx here: apt-get install nginx"),
    pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl here"),
    pytest.mark.skipif(not (DIST / "index.html").exists(), reason="no built page: run make setup"),
]


def find_block(kind: str, words: str) -> str:
    """The single block on the hosting pages that contains these words."""
    pages = (f"docs/how-to/scale/{name}.md" for name in ("host-the-page", "cache-for-a-crowd"))
    (found,) = (text for page in pages for text in read_blocks(page, kind, words))
    return found


Answer = tuple[int, "Message[str, str]", bytes]


class Site:
    """nginx with one of our files, on its own port."""

    def __init__(self, folder: Path, file: str, **instead: str) -> None:
        new = "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=localhost"
        names = "-addext subjectAltName=DNS:localhost -keyout privkey.pem -out fullchain.pem"
        subprocess.run(["openssl", *new.split(), *names.split()], cwd=folder, check=True, capture_output=True)
        self.port = free_port()
        text = (HOSTING / file).read_text()
        for old, new in (
            {"listen 443": f"listen 127.0.0.1:{self.port}", "/etc/posecast": str(folder)} | instead
        ).items():
            assert old in text, old
            text = text.replace(old, new)
        (folder / "site.conf").write_text(text)
        places = "".join(
            f"{kind}_temp_path {folder}/{kind};"
            for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
        )
        (folder / "nginx.conf").write_text(
            f"pid {folder}/pid; daemon off; master_process off; error_log {folder}/errors;"
            "events { worker_connections 900; }"
            f"http {{ include /etc/nginx/mime.types; access_log off; {places} include {folder}/site.conf; }}"
        )
        self.command = ("nginx", "-p", str(folder), "-c", str(folder / "nginx.conf"))
        self.trust = ssl.create_default_context(cafile=str(folder / "fullchain.pem"))

    def get(self, path: str, **headers: str) -> Answer:
        """Status, headers, body."""
        request = urllib.request.Request(f"https://localhost:{self.port}{path}", headers=headers)
        try:
            with urllib.request.urlopen(request, timeout=10, context=self.trust) as answer:
                return answer.status, answer.headers, answer.read()
        except urllib.error.HTTPError as e:
            return e.code, e.headers, e.read()

    def answers(self) -> bool:
        """Whether it does."""
        try:
            return self.get("/")[0] == 200
        except OSError:
            return False


@pytest.fixture
def site(stack: Stack, tmp_path: Path) -> Callable[..., Site]:
    """Starts nginx."""

    def start(file: str, **instead: str) -> Site:
        made = Site(tmp_path, file, **instead)
        part = stack.start("nginx", *made.command)

        def up() -> bool:
            assert part.process.poll() is None, part.log
            return made.answers()

        until("nginx answers", up)
        return made

    return start


def test_nginx_serves_the_page_with_its_headers(site: Callable[..., Site], tmp_path: Path) -> None:
    page = tmp_path / "page"
    shutil.copytree(DIST, page)
    (page / "config.json").write_text('{"relay": "https://relay.example"}')
    lists = {'# demo "*";': 'demo "*";', "# hubo ": "hubo "}
    at = site("nginx.conf", **{"/srv/posecast": str(page)}, **lists)

    found = POLICY.search((page / "index.html").read_text())
    assert found is not None
    own = found[1].replace("&#39;", "'")
    for path, cache, frames in (
        ("/", "no-cache", "'none'"),
        ("/index.html", "no-cache", "'none'"),
        ("/config.json", "no-cache", "'none'"),
        (
            f"/assets/{next((page / 'assets').glob('worker-*.js')).name}",
            "public, max-age=31536000, immutable",
            "'none'",
        ),
        ("/embed/", "no-cache", "'self'"),
        ("/embed/demo", "no-cache", "*"),
        ("/embed/hubo", "no-cache", "'self' https://course.example"),
        ("/embed/g1", "no-cache", "'self'"),
        ("/embed/hubo/", "no-cache", "'self' https://course.example"),
        ("/guide/gallery.html", "no-cache", "'none'"),
        ("/guide/gallery/knee/embed/index.html", "no-cache", "'self'"),
    ):
        status, headers, body = at.get(path)
        assert status == 200, path
        assert headers.get_all("cache-control") == [cache], path
        assert headers.get_all("content-security-policy") == [f"{own}; frame-ancestors {frames}"], path
        assert headers["x-frame-options"] == ("DENY" if frames == "'none'" else None), path
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        readers = "*" if path == "/config.json" or path.startswith("/assets/") else None
        assert headers["access-control-allow-origin"] == readers, path
        isolated = (
            ("require-corp", "cross-origin") if path.startswith(("/embed/", "/assets/")) else (None, None)
        )
        assert (headers[EMBEDDER], headers[RESOURCE]) == isolated, path
        assert headers["strict-transport-security"]
        assert "1." not in (headers["server"] or ""), "its version is nobody's business"
        if path.startswith("/embed/"):
            assert body == (page / "embed/index.html").read_bytes()
    for gone in (
        "/assets/gone.js",
        "/nothing",
        "/.vite/manifest.json",
        "/embed/UP",
        "/index.html.br",
        "/index.html.gz",
        "/docs/",
    ):
        status, headers, body = at.get(gone)
        assert (status, headers.get_all("cache-control")) == (404, ["no-cache"]), gone
        assert b'id="root"' not in body, "never the page instead"

    script = next(page.glob("assets/index-*.js"))
    _, headers, body = at.get(f"/assets/{script.name}", **{"accept-encoding": "gzip"})
    assert headers["content-encoding"] == "gzip"
    assert headers["content-type"].partition(";")[0].endswith("javascript")
    assert gzip.decompress(body) == script.read_bytes()
    immutable = "public, max-age=31536000, immutable"
    for path, cache in (("/", "no-cache"), (f"/assets/{script.name}", immutable)):
        status, headers, _ = at.get(path, **{"if-none-match": at.get(path)[1]["etag"]})
        assert (status, headers["cache-control"]) == (304, cache), path
    assert json.loads(at.get("/config.json")[2]) == {"relay": "https://relay.example"}
    for each in (page / "assets").glob("*.js"):  # one could keep an old page alive
        assert "serviceWorker.register" not in each.read_text(), each.name


def test_nginx_before_a_relay_adds_nothing_and_holds_nothing_back(
    site: Callable[..., Site], stack: Stack, tmp_path: Path
) -> None:
    robots = tmp_path / "robots.toml"
    robots.write_text("[robots.demo.anyone]\nframes = ['https://course.example']\n")
    robots.chmod(0o600)
    flags = ("--static", str(DIST), "--robots", str(robots), "--trusted-proxies", "127.0.0.1")
    _, address, zenoh = stack.relay(flags=flags)
    stack.edge(zenoh, "--source", "demo")
    lane = {
        "/etc/nginx/nginx-lane.rules": str(HOSTING / "nginx-lane.rules"),
        "/var/log/nginx": str(tmp_path),
        "/var/cache/posecast": str(tmp_path / "kept"),
    }
    at = site("nginx-relay.conf", **{"127.0.0.1:8080": address}, **lane)
    until("the robot is on air", lambda: at.get("/api/v1/robots/demo/state")[0] == 200)

    for path in ("/", "/embed/demo", "/embed/", "/api/v1/robots/demo", "/config.json"):
        with urllib.request.urlopen(f"http://{address}{path}", timeout=10) as answer:
            said = {k.lower(): v for k, v in answer.headers.items()}
        status, headers, _ = at.get(path)
        assert status == 200, path
        for name in (
            "content-security-policy",
            "x-frame-options",
            "cache-control",
            "access-control-allow-origin",
        ):
            assert headers.get_all(name) == ([said[name]] if name in said else None), (path, name)
        assert headers.get_all("strict-transport-security") == ["max-age=31536000"], path
    assert at.get("/embed/demo")[1]["content-security-policy"].endswith("'self' https://course.example")
    for inside in ("/livez", "/readyz", "/metrics"):
        assert at.get(inside)[0] == 404, inside

    for kept in ("MISS", "MISS"):
        status, headers, _ = at.get("/assets/gone.js")
        assert (status, headers["cache-control"], headers["x-cache"]) == (404, None, kept)

    stream = f"https://localhost:{at.port}/api/v1/robots/demo/live.sse?hz=10"
    with urllib.request.urlopen(stream, timeout=10, context=at.trust) as answer:
        assert sum(answer.readline().startswith(b"data:") for _ in range(60)) >= 10
    _frames_through(at)

    slow = []
    for _ in range(400):
        link = socket.create_connection(("127.0.0.1", at.port), 10)
        link.send(b"\x16\x03\x01\x02\x00")
        slow.append(link)
    began_s = time.monotonic()
    assert at.get("/api/v1/robots")[0] == 200
    print(f"with 400 slow requests open an answer took {(time.monotonic() - began_s) * 1e3:.0f} ms")
    for link in slow:
        link.close()


def _frames_through(at: Site) -> None:
    import websockets

    async def watch() -> int:
        url = f"wss://localhost:{at.port}/api/v1/robots/demo/live?hz=10"
        frames = 0
        async with websockets.connect(url, ssl=at.trust, proxy=None) as link:
            while frames < 10:
                message: Any = await asyncio.wait_for(link.recv(), 20)
                frames += isinstance(message, bytes)
        return frames

    assert asyncio.run(watch()) == 10


async def test_a_hall_behind_one_address_opens_the_page_at_once(
    site: Callable[..., Site], stack: Stack, tmp_path: Path
) -> None:
    _, address, zenoh = stack.relay(flags=("--static", str(DIST), "--trusted-proxies", "127.0.0.1"))
    stack.edge(zenoh, "--source", "demo")
    lane = {
        "/etc/nginx/nginx-lane.rules": str(HOSTING / "nginx-lane.rules"),
        "/var/log/nginx": str(tmp_path),
        "/var/cache/posecast": str(tmp_path / "kept"),
        "rate=200r/s": "rate=8r/s",
        "burst=16000": "burst=640",
        "rate=5000r/s": "rate=200r/s",
        "burst=100000": "burst=4000",
    }
    at = site("nginx-relay.conf", **{"127.0.0.1:8080": address}, **lane)
    until("the robot is on air", lambda: at.get("/api/v1/robots/demo/state")[0] == 200)

    files = sorted(path for path in (DIST / "assets").iterdir() if path.suffix in (".js", ".css"))
    assert len(files) >= FILES_OF_A_LOAD
    page = [f"/assets/{file.name}" for file in files[:FILES_OF_A_LOAD]]
    page += ["/", "/config.json", "/favicon.svg", "/api/v1/robots", "/api/v1/robots/demo"]
    kept: Counter[str] = Counter()

    async def load() -> set[int]:
        link, found = Link(at.port, at.trust), set[int]()
        for path in page:
            answer = await link.ask(path, **{"accept-encoding": "gzip"})
            found.add(answer.status)
            if answer.headers.get("x-cache") == "MISS":
                kept[path] += 1
        link.cut()
        return found

    found = await asyncio.gather(*(load() for _ in range(HALL)))
    assert set().union(*found) == {200}
    assert set(kept) == set(page[:FILES_OF_A_LOAD])
    assert set(kept.values()) == {1}, "the relay is asked once for a file"

    script = next((DIST / "assets").glob("index-*.js"))
    for accepts, encoding, suffix in (
        ("gzip, deflate, br", "br", ".br"),
        ("br;q=0, gzip", "gzip", ".gz"),
        ("identity", None, ""),
    ):
        for _ in range(2):
            _, headers, body = at.get(f"/assets/{script.name}", **{"accept-encoding": accepts})
            assert headers["content-encoding"] == encoding
            assert body == script.with_name(f"{script.name}{suffix}").read_bytes()
        assert headers["x-cache"] == "HIT"

    # the commands of docs/how-to/scale/cache-for-a-crowd.md that check a cache
    until("there is a segment", lambda: json.loads(at.get("/api/v1/robots/demo/past")[2])["newest"])
    look = find_block("sh", "x-cache").replace("cdn.example", f"localhost:{at.port}").replace("NAME", "demo")
    trust = {**os.environ, "CURL_CA_BUNDLE": str(tmp_path / "fullchain.pem")}
    done = subprocess.run(["bash", "-euc", look], env=trust, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["X-Cache:", "MISS", "X-Cache:", "HIT"]


def test_nginx_takes_the_lines_for_a_hall(tmp_path: Path) -> None:
    lines = find_block("nginx", "worker_connections")
    (tmp_path / "nginx.conf").write_text(f"pid {tmp_path}/pid; error_log stderr; {lines} http {{ }}")
    subprocess.run(["nginx", "-t", "-p", tmp_path, "-c", tmp_path / "nginx.conf"], check=True, timeout=20)


def test_a_relays_own_page_takes_its_config_file(stack: Stack, tmp_path: Path) -> None:
    page = tmp_path / "page"
    shutil.copytree(DIST, page)
    _, address, _ = stack.relay(flags=("--static", str(page)))

    def ask() -> Any:
        with urllib.request.urlopen(f"http://{address}/config.json", timeout=10) as answer:
            return json.load(answer)

    assert ask() == {}
    (page / "config.json").write_text('{"lane": "https://cdn.example"}')
    assert ask() == {"lane": "https://cdn.example"}, "without a restart"


def test_who_exceeds_a_limit_is_told_when_to_come_again(
    site: Callable[..., Site], stack: Stack, tmp_path: Path
) -> None:
    _, address, _ = stack.relay(flags=("--static", str(DIST), "--trusted-proxies", "127.0.0.1"))
    low = {
        "/etc/nginx/nginx-lane.rules": str(HOSTING / "nginx-lane.rules"),
        "/var/log/nginx": str(tmp_path),
        "/var/cache/posecast": str(tmp_path / "kept"),
        "rate=200r/s": "rate=1r/m",
        "burst=16000": "burst=3",
    }
    at = site("nginx-relay.conf", **{"127.0.0.1:8080": address}, **low)
    answers = [at.get("/config.json") for _ in range(6)]
    assert {status for status, _, _ in answers} == {200, 503}
    _, headers, body = answers[-1]
    assert (headers["retry-after"], headers["content-type"]) == ("2", "application/json")
    assert (headers["cache-control"], headers["access-control-allow-origin"]) == ("no-store", "*")
    assert "too many requests" in json.loads(body)["error"]
    file = next((DIST / "assets").glob("index-*.js"))
    assert at.get(f"/assets/{file.name}")[0] == 200, "files have a limit of their own"
    assert at.get("/assets/../config.json")[0] == 503
