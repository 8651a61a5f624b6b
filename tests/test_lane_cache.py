"""The lane through real caches, configured as in infra/hosting: each segment is requested once from the
relay."""

from __future__ import annotations

import asyncio
import json
import os
import re
import resource
import shutil
import signal
import ssl
import subprocess
import time
import urllib.request
from collections import Counter
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from pathlib import Path
from urllib.parse import unquote

import pytest
from posecast_testing import Process, free_port, until, until_async

from tests.conftest import BIN, Stack
from tests.doc_blocks.block import read_blocks
from tests.lane import ROBOT, Answer, Follower, Link, Origin

HOSTING = Path(__file__).resolve().parent.parent / "infra/hosting"
CROWD = 30
HTTP2 = (
    b"HTTP2" in subprocess.run(["curl", "-V"], check=True, capture_output=True).stdout
    if shutil.which("curl")
    else False
)
THOUSAND = 1100  # nginx counts to 1023
PAST_S = 12  # how far back anyone may look
HOLD_S = 8
LIST_S = 10  # how long a cache keeps a list
CONTACT = {"access-control-allow-origin": "*", "vary": "authorization"}
CONTACT |= {"access-control-expose-headers": "age, date, etag, retry-ms, retry-after"}

pytestmark = [pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl here")]
PAGE = "docs/how-to/scale/cache-for-a-crowd.md"
NO_NGINX = pytest.mark.skipif(not shutil.which("nginx"), reason="no nginx: apt-get install nginx")
OWN = pytest.param("own", marks=NO_NGINX)  # an nginx that somebody wrote by the page
KINDS = [
    pytest.param("nginx", marks=NO_NGINX),
    pytest.param(
        "varnish",
        marks=[
            pytest.mark.full,
            pytest.mark.skipif(not shutil.which("varnishd"), reason="no varnishd: apt-get install varnish"),
        ],
    ),
]


@dataclass
class World:
    """A relay with a robot on air, whose segments last a second."""

    stack: Stack
    address: str
    zenoh: str
    token: str
    edge: Process
    robots: Path

    def set_blackout(self, is_dark: bool) -> None:
        """For anyone: as if an operator had written it into the file."""
        dark = "[robots.demo.anyone]\nblackout = true\n"
        text = self.robots.read_text().replace(dark, "[robots.demo.anyone]\n")
        self.robots.write_text(text.replace("[robots.demo.anyone]\n", dark) if is_dark else text)

    def set_on_air(self) -> None:
        """Begin a new run of the robot."""
        self.edge = self.stack.edge(self.zenoh, "--source", "demo", "--key-interval", "1")


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    """One for all tests of this file."""
    folder = tmp_path_factory.mktemp("lane")
    robots, stack = folder / "robots.toml", Stack(folder)

    def manage(*words: str) -> str:
        command = [f"{BIN}/posecast-relay", "robots", *words, "--robots", str(robots)]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    manage("add", "demo", "--private")
    with robots.open("a") as file:
        file.write(f'[robots.demo.anyone]\npast = "{PAST_S}s"\n[robots.demo.link]\npast = "{PAST_S}s"\n')
    token = manage("link", "demo").strip().rpartition("=")[2]
    try:
        flags = ("--robots", str(robots), "--trusted-proxies", "127.0.0.1")
        _, address, zenoh = stack.relay(flags=flags)
        edge = stack.edge(zenoh, "--source", "demo", "--key-interval", "1")

        def has_past() -> bool:
            try:
                with urllib.request.urlopen(f"http://{address}{ROBOT}/past", timeout=5) as answer:
                    return json.load(answer)["newest"] is not None
            except OSError:
                return False

        until("there is a segment", has_past)
        yield World(stack, address, zenoh, token, edge, robots)
    finally:
        for part in reversed(stack.parts):
            part.stop()
            print(part.log[-3000:])


@dataclass
class Cache:
    """A cache in front of a relay, and the requests that it has sent to the relay."""

    origin: Origin
    port: int
    trust: ssl.SSLContext | None

    def connect(self) -> Link:
        """A connection of its own."""
        return Link(self.port, self.trust)

    async def find_next(self) -> str:
        """The address of the segment that comes next."""
        asker = Follower(Link(int(self.origin.address.rpartition(":")[2])))
        task = asyncio.create_task(asker.follow())
        await until_async("there is a segment", lambda: len(asker.got) >= 2)
        task.cancel()
        take, index = asker.got[-1]
        return f"{ROBOT}/past/public/{take}/{index + 1}"


def set_up_nginx(folder: Path, relay: str) -> tuple[tuple[str, ...], int, ssl.SSLContext | None]:
    """The command, the port, and whom to trust."""
    new = "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=localhost"
    names = "-addext subjectAltName=DNS:localhost -keyout privkey.pem -out fullchain.pem"
    subprocess.run(["openssl", *new.split(), *names.split()], cwd=folder, check=True, capture_output=True)
    port = free_port()
    instead = {
        "listen 443": f"listen 127.0.0.1:{port}",
        "/etc/posecast": str(folder),
        "server relay.example:443": f"server {relay}",
        "set $lane_relay https": "set $lane_relay http",
        "/var/cache/posecast": f"{folder}/kept",
        "/etc/nginx/nginx-lane.rules": str(HOSTING / "nginx-lane.rules"),
        "/var/log/nginx": str(folder),
    }
    text = replace_all((HOSTING / "nginx-lane.conf").read_text(), instead)
    return start_nginx(folder, text), port, ssl.create_default_context(cafile=str(folder / "fullchain.pem"))


def set_up_own(folder: Path, relay: str) -> tuple[tuple[str, ...], int, ssl.SSLContext | None]:
    """The same, as the page says that one writes it."""
    (text,) = read_blocks(PAGE, "nginx")
    port = free_port()
    instead = {
        "listen 80": f"listen 127.0.0.1:{port}",
        "http://relay.example": f"http://{relay}",
        "/var/cache/lane": f"{folder}/kept",
    }
    return start_nginx(folder, replace_all(text, instead)), port, None


def start_nginx(folder: Path, lane: str) -> tuple[str, ...]:
    """The command for an nginx that does this and nothing else."""
    (folder / "lane.conf").write_text(lane)
    kinds = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    places = "".join(f"{kind}_temp_path {folder}/{kind};" for kind in kinds)
    user = "" if os.getuid() else "user root;"  # nobody else may read a test's folder
    (folder / "nginx.conf").write_text(
        f"{user} pid {folder}/pid; daemon off; worker_processes 2; error_log {folder}/errors;"
        "events { worker_connections 4000; }"
        f"http {{ access_log off; {places} include {folder}/lane.conf; }}"
    )
    return "nginx", "-p", str(folder), "-c", str(folder / "nginx.conf")


def set_up_varnish(folder: Path, relay: str) -> tuple[tuple[str, ...], int, ssl.SSLContext | None]:
    """The same."""
    host, _, at = relay.rpartition(":")
    instead = {'.host = "127.0.0.1"': f'.host = "{host}"', '.port = "8080"': f'.port = "{at}"'}
    text = (HOSTING / "varnish.vcl").read_text()
    (folder / "lane.vcl").write_text(replace_all(text, instead))
    flags = re.findall(r"^#   varnishd (.*)$", text, re.MULTILINE)[0]
    port = free_port()
    at_home = {
        "/etc/varnish/varnish.vcl": str(folder / "lane.vcl"),
        ":6081": f"127.0.0.1:{port}",
        "malloc,1g": "malloc,64m",
    }
    return (
        ("varnishd", "-F", "-j", "none", "-n", str(folder / "work"), *replace_all(flags, at_home).split()),
        port,
        None,
    )


def replace_all(text: str, instead: dict[str, str]) -> str:
    """All of them must be there."""
    for old, new in instead.items():
        assert old in text, old
        text = text.replace(old, new)
    return text


@pytest.fixture(scope="module", autouse=True)
def many_files() -> Iterator[None]:
    """As many as the machine lets one have."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard if hard < 65536 else max(soft, 65536), hard))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


@pytest.fixture(params=KINDS)
async def cache(request: pytest.FixtureRequest, world: World, tmp_path: Path) -> AsyncIterator[Cache]:
    """Each kind, empty."""
    origin = Origin(world.address)
    relay = f"127.0.0.1:{await origin.start()}"
    set_up = {"nginx": set_up_nginx, "varnish": set_up_varnish, "own": set_up_own}[request.param]
    command, port, trust = set_up(tmp_path, relay)
    part = Stack(tmp_path).start(request.param, *command)
    made = Cache(origin, port, trust)

    async def is_up() -> bool:
        assert part.process.poll() is None, part.log
        try:
            return (await made.connect().ask("/")).status == 404  # it serves the lane and nothing else
        except OSError:
            return False

    try:
        for _ in range(1000):
            if await is_up():
                break
            await asyncio.sleep(0.02)
        assert await is_up()
        assert origin.asked == []
        yield made
    finally:
        part.stop()
        origin.stop()
        print(part.log[-3000:])


def check_refusal(answer: Answer) -> None:
    """The cache itself refuses the request, and the connection ends."""
    assert answer.status == 400
    assert answer.headers["content-type"] == "application/json"
    assert set(json.loads(answer.body)) == {"error"}
    assert answer.headers["cache-control"] == "private, no-store"
    assert answer.headers["connection"] == "close"
    assert "x-cache" not in answer.headers or answer.headers["x-cache"] in {"", "MISS"}


async def find_model(cache: Cache) -> str:
    """The hash of the robot's model."""
    relay = Link(int(cache.origin.address.rpartition(":")[2]))
    robots = json.loads((await relay.ask("/api/v1/robots")).body)["robots"]
    (model,) = (each["model"] for each in robots if each["robot"] == "demo")
    return str(model)


@asynccontextmanager
async def play_crowd(cache: Cache) -> AsyncIterator[list[Follower]]:
    """Many who follow at the same time."""
    crowd = [Follower(cache.connect()) for _ in range(CROWD)]
    tasks = [asyncio.create_task(one.follow()) for one in crowd]
    try:
        yield crowd
        assert [task.exception() for task in tasks if task.done()] == []
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


@pytest.mark.parametrize("cache", [*KINDS, OWN], indirect=True)
async def test_a_relay_is_asked_once_for_a_segment(cache: Cache, world: World) -> None:
    async with play_crowd(cache) as crowd:
        await until_async("all follow", lambda: all(len(one.got) >= 4 for one in crowd))
        world.edge.process.send_signal(signal.SIGSTOP)
        await until_async("not yet, says the relay", lambda: cache.origin.count(204) > 0)
        shown = {one.got[-1] for one in crowd}
        world.edge.process.send_signal(signal.SIGCONT)
        await until_async("it goes on", lambda: all(one.got[-1] not in shown for one in crowd))
        last = max(take for one in crowd for take, _ in one.got)
        before = {one.got[-1][0] for one in crowd}
        world.edge.stop()
        world.set_on_air()
        again = lambda: all(one.got[-1][0] not in before and one.got[-1][1] > 1 for one in crowd)  # noqa: E731
        await until_async("all follow the next run", again)

    for one in crowd:
        assert one.refused == []
        for (take, index), (next_take, next_index) in zip(one.got, one.got[1:], strict=False):
            assert (next_take, next_index) == (take, index + 1) or (next_take != take and next_index == 0)
    given = Counter(cache.origin.list_segments())
    assert len(given) >= 8, last
    assert set(given.values()) == {1}
    # apart from that: one answer for each hold in a pause, one where a take ends, one a second to who begins
    assert cache.origin.count(204) <= 3
    rest = Counter(path for path, answer in cache.origin.answered if path not in given)
    print(f"{len(given)} segments, one request each; besides: {dict(rest)}")


# with a thousand connections; in `make test`, those of test_who_asked_first_may_leave wait for one as well
@pytest.mark.full
async def test_of_a_thousand_who_wait_none_goes_to_the_relay_as_well(cache: Cache, world: World) -> None:
    path = await cache.find_next()
    world.edge.process.send_signal(signal.SIGSTOP)  # it will be held
    try:
        links = [cache.connect() for _ in range(THOUSAND)]
        for some in (links[at : at + 100] for at in range(0, THOUSAND, 100)):
            await asyncio.gather(*(link.send(path) for link in some))
    finally:
        world.edge.process.send_signal(signal.SIGCONT)
    answers = await asyncio.gather(*(link.receive() for link in links))
    assert set(cache.origin.asked) == {path}
    assert len(cache.origin.asked) == 1 + cache.origin.count(204)  # again after "not yet"
    assert cache.origin.count(204) <= 5
    assert len({answer.body for answer in answers if answer.is_segment}) <= 1
    for link in links:
        link.cut()


async def test_who_asked_first_may_leave(cache: Cache, world: World) -> None:
    path = await cache.find_next()
    world.edge.process.send_signal(signal.SIGSTOP)  # it will be held
    try:
        first = cache.connect()
        await first.send(path)
        await until_async("the relay is asked", lambda: cache.origin.asked == [path])
        first.cut()
        others = [asyncio.create_task(cache.connect().ask(path)) for _ in range(20)]
        left = cache.connect()
        await left.send(path)
        left.cut()
    finally:
        world.edge.process.send_signal(signal.SIGCONT)
    answers = await asyncio.gather(*others)
    assert len({answer.body for answer in answers}) == 1
    assert {answer.is_segment for answer in answers} == {True}
    assert cache.origin.asked == [path]


async def test_the_answers_are_as_the_relay_gave_them(cache: Cache) -> None:
    link = cache.connect()
    path = await cache.find_next()
    first, second = await link.ask(path), await link.ask(path)
    ((_, itself),) = cache.origin.answered
    for answer, kept in ((first, "MISS"), (second, "HIT")):
        assert (answer.status, answer.body, answer.headers["x-cache"]) == (200, itself.body, kept)
        for name in ("cache-control", "etag", "access-control-allow-origin", "content-type"):
            assert answer.headers[name] == itself.headers[name], name
        assert "set-cookie" not in answer.headers
    had = await link.ask(path, **{"if-none-match": first.headers["etag"]})
    assert (had.status, had.body) == (304, b"")
    cookies = await link.ask(path, cookie="a=b")
    assert cookies.headers["x-cache"] == "HIT"
    assert cache.origin.asked == [path]
    said = {"cookie": "a=b", "x-forwarded-for": "192.0.2.1"}
    assert (await link.ask(f"{ROBOT}/past/public/{0:016x}/0", **said)).status == 404
    assert b"cookie" not in cache.origin.heads[-1]
    forwarded = re.findall(rb"x-forwarded-for: (.*)\r", cache.origin.heads[-1])
    assert [each.split(b", ")[-1] for each in forwarded] == [b"127.0.0.1"], "by its own eyes"


async def test_who_shows_a_token_is_neither_answered_from_it_nor_kept(cache: Cache, world: World) -> None:
    link = cache.connect()
    path = await cache.find_next()
    shown = {"authorization": f"Bearer {world.token}"}
    own = [await link.ask(path, **shown) for _ in range(2)]
    public = [await link.ask(path) for _ in range(2)]
    own.append(await link.ask(path, **shown))
    assert {answer.body for answer in own} == {answer.body for answer in public}
    for answer in own:
        assert answer.is_segment
        assert answer.headers["cache-control"] == "private, no-store"
        assert answer.headers["x-cache"] in {"BYPASS", "MISS"}
    assert [answer.headers["x-cache"] for answer in public] == ["MISS", "HIT"]
    assert {answer.headers["cache-control"].partition(",")[0] for answer in public} == {"public"}
    assert cache.origin.asked == [path] * 4
    bad = await link.ask(path, authorization="Bearer wrong")
    assert bad.status == 401


async def test_made_up_addresses_fill_nothing(cache: Cache) -> None:
    link = cache.connect()
    summary = f"{ROBOT}/past?view=public"
    for path in (f"{summary}&n=1", f"{summary}&view=other", f"{summary}&n=1"):
        assert (await link.ask(path)).headers["x-cache"] in {"BYPASS", "MISS"}, path
    assert len(cache.origin.asked) == 3
    page = f"{ROBOT}/past/public/2026-11-22T14:20Z"
    ends = ("/past?view=public", "/keys?every=2", "/model/", f"/past/public/{0:016x}/0?")
    for path in (f"{at}?{n}={end}" for n, end in enumerate(ends) for at in (page, f"{page}/keys")):
        for _ in range(2):
            assert (await link.ask(path)).headers["x-cache"] in {"BYPASS", "MISS"}, path
    assert len(cache.origin.asked) == 3 + 2 * 2 * len(ends)
    cache.origin.asked.clear()
    for path in (
        "/",
        "/api/v1/robots",
        ROBOT,
        f"{ROBOT}/live",
        f"{ROBOT}/live.sse",
        f"{ROBOT}/pasture",
        "/readyz",
    ):
        assert (await link.ask(path)).status == 404, path
    assert cache.origin.asked == [], "the rest is refused here"
    for path in (f"{ROBOT}/past%0a", f"{ROBOT}/past/public%20", f"{ROBOT}/model/manifest.json"):
        assert (await link.ask(path)).status == 404, path
    assert cache.origin.asked == [], "nor does a line break reach the relay"


async def test_a_segment_has_one_name_whatever_is_added_to_it(cache: Cache) -> None:
    path = await cache.find_next()
    odd = ("every=1", "every=2", "view=public", "view=x", "after=0000000000000000,1", "a=b", "token%=x")
    asked = [asyncio.create_task(cache.connect().ask(f"{path}?{each}")) for each in odd]
    answers = [await each for each in (*asked, asyncio.create_task(cache.connect().ask(path)))]
    assert len({answer.body for answer in answers}) == 1
    assert answers[0].is_segment
    assert cache.origin.asked == [path], "one is held, for all of them"
    page = f"{ROBOT}/past/public/2026-11-22T14:20Z"
    for each in ("?every=1", "?view=public", "/keys?after=0000000000000000,1"):
        assert (await cache.connect().ask(page + each)).headers["x-cache"] in {"BYPASS", "MISS"}
    assert len(cache.origin.asked) == 4


async def test_what_stands_behind_a_hash_is_refused(cache: Cache) -> None:
    """The relay would ignore the parameter and answer, so each would be another cache key for a segment that
    is held."""
    path = await cache.find_next()
    for each in (f"{path}#1", f"{path}#a?b", f"{path}?#c", f"{ROBOT}/past#1", f"{ROBOT}/past?view=public#1"):
        check_refusal(await cache.connect().ask(each))
    assert cache.origin.asked == []


async def test_a_models_file_has_one_name_however_it_is_written(cache: Cache) -> None:
    model = f"{ROBOT}/model/{await find_model(cache)}"
    itself = await cache.connect().ask(f"{model}/manifest.json", **{"accept-encoding": "gzip"})
    assert itself.status == 200
    letters = [
        f"{model}/manifest.json".replace(
            "manifest", f"{'manifest'[:n]}%{ord('manifest'[n]):02x}{'manifest'[n + 1 :]}"
        )
        for n in range(8)
    ]
    others = [
        "/manifest%2ejson",
        "/manifest%2Ejson",
        "%2fmanifest.json",
        "%2Fmanifest.json",
        "/manifest.json?",
        "/manifest.json?a=1",
    ]
    spelt = [*letters, *(model + other for other in others), f"{model}/manifest.json".replace("api", "%61pi")]
    spelt += [f"{model}/manifest.json#x", f"{model}/manifest.json#x?y", f"{model}/manifest.json%23"]
    for path in spelt:
        answer = await cache.connect().ask(path, **{"accept-encoding": "gzip"})
        assert (answer.status, answer.body) == (200, itself.body) or answer.status in {400, 404}, path
        assert cache.origin.asked[:1] == [f"{model}/manifest.json"]
        assert set(cache.origin.asked[1:]) <= {f"{model}/manifest.json%23"}, "another file, that is not there"


async def test_names_that_pages_have_to_escape_reach_the_relay(cache: Cache) -> None:
    """A space, letters of any language, and what encodeURIComponent writes."""
    model = f"{ROBOT}/model/{await find_model(cache)}"
    name = "a%20b/%C3%A9%EC%86%90%2B%40.glb"
    assert (await cache.connect().ask(f"{model}/{name}")).status == 404
    assert [unquote(path) for path in cache.origin.asked] == [unquote(f"{model}/{name}")]
    for other in (name.replace("%C3", "%c3"), name.replace("a%20b", "%61%20b"), name.replace("/", "%2F")):
        assert (await cache.connect().ask(f"{model}/{other}")).status == 404
    assert len(set(cache.origin.asked)) == 1


async def test_a_token_in_an_address_is_refused_as_the_relay_refuses_it(cache: Cache, tmp_path: Path) -> None:
    path, model = await cache.find_next(), await find_model(cache)
    for each in (path, f"{ROBOT}/past", f"{ROBOT}/model/{model}/manifest.json"):
        for odd in ("token=hush", "access_token=hush", "a=b&token=hush", "token"):
            answer = await cache.connect().ask(f"{each}?{odd}")
            check_refusal(answer)
            assert "token" in json.loads(answer.body)["error"]
    assert cache.origin.asked == []
    if cache.trust is not None:  # nginx
        log = tmp_path / "posecast.log"
        await until_async("it is logged", lambda: log.read_text().count(f" {path} ") == 4)
        assert "hush" not in log.read_text()


async def test_keys_of_each_nth_segment_have_few_names(cache: Cache) -> None:
    page = f"{ROBOT}/past/public/2026-11-22T14:20Z/keys"
    answers = [await cache.connect().ask(f"{page}?every={n}") for n in (150, 151, 600, 999, 1000)]
    answers += [await cache.connect().ask(page + one) for one in ("?every=1", "?", "")]
    assert {answer.status for answer in answers} == {200}
    assert set(cache.origin.asked) == {f"{page}?every=150", page}
    cache.origin.asked.clear()
    for n in (1001, 9999, 10000):
        check_refusal(await cache.connect().ask(f"{page}?every={n}"))
    assert cache.origin.asked == []
    end_s = asyncio.get_running_loop().time() + 20
    day, found = f"{ROBOT}/past/public/2026-02-30", set[tuple[int, str]]()
    while (400, "HIT") not in found:  # what the relay refuses as impossible is kept for a second
        assert asyncio.get_running_loop().time() < end_s, found
        answer = await cache.connect().ask(day)
        found.add((answer.status, answer.headers["x-cache"]))
    assert {status for status, _ in found} == {400}


@pytest.mark.parametrize(
    "head",
    [
        "POST {} HTTP/1.1\r\nHost: localhost\r\nContent-Length: 900\r\n\r\n",
        "GET {} HTTP/1.1\r\nHost: localhost\r\nContent-Length: 900\r\n\r\n",
        "GET {} HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n",
        "PURGE {} HTTP/1.1\r\nHost: localhost\r\n\r\n",
        "GET {} HTTP/1.1\r\nHost: localhost\r\n",
        "GET {}",
    ],
)
async def test_who_sends_what_no_page_does_drop_by_drop_is_let_go(cache: Cache, head: str) -> None:
    """A body, a method, a header without end: each drop used to restart the wait."""
    link = cache.connect()
    await link.write(head.format(await cache.find_next()).encode())
    got = asyncio.create_task(link.read_until_closed())
    for _ in range(150):  # of a tenth of a second: for a head there are some seconds
        with suppress(ConnectionError):
            await link.write(b"x")
        await asyncio.wait((got,), timeout=0.1)
        if got.done():
            break
    assert got.done(), "it is still read"
    if head.endswith("\r\n\r\n"):
        assert got.result().startswith(b"HTTP/1.1 400 ")
    assert cache.origin.asked == []


@pytest.mark.skipif(not HTTP2, reason="no curl with HTTP/2 here")
async def test_a_body_that_http2_does_not_announce_is_refused(cache: Cache) -> None:
    if cache.trust is None:
        pytest.skip("Varnish is asked by HTTP/1.1")
    path = f"https://localhost:{cache.port}{await cache.find_next()}"
    command = ("curl", "-ksS", "--http2", "-X", "GET", "-T", "-", "-w", "%{http_version} %{http_code}")
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    curl = await asyncio.create_subprocess_exec(*command, "-o", "/dev/null", path, **pipes)  # type: ignore[arg-type]
    told = asyncio.create_task(curl.stdout.read() if curl.stdout else asyncio.sleep(0))
    for _ in range(150):
        with suppress(OSError):
            assert curl.stdin is not None
            curl.stdin.write(b"x")
            await curl.stdin.drain()
        await asyncio.wait((told,), timeout=0.1)
        if told.done():
            break
    assert told.done(), "it is still read"
    assert told.result() == b"2 413"
    assert cache.origin.asked == []
    await curl.wait()


async def test_a_page_of_elsewhere_may_ask_whether_it_may_show_a_token(cache: Cache) -> None:
    link = cache.connect()
    await link.write(
        f"OPTIONS {ROBOT}/past HTTP/1.1\r\nHost: localhost\r\nOrigin: https://a.example\r\n\r\n".encode()
    )
    answer = await link.receive()
    assert (answer.status, "authorization" in answer.headers["access-control-allow-headers"]) == (204, True)


async def test_a_token_of_nought_is_one(cache: Cache) -> None:
    path = await cache.find_next()
    public = await cache.connect().ask(path)
    assert public.headers["x-cache"] == "MISS"
    shown = await cache.connect().ask(path, authorization="0")
    assert shown.headers["x-cache"] in {"BYPASS", "MISS"}
    assert len(cache.origin.asked) == 2


@pytest.mark.parametrize("cache", [*KINDS, OWN], indirect=True)
async def test_a_crowd_after_a_pause_gets_no_list_of_before_it(cache: Cache) -> None:
    """It may name what was deleted meanwhile."""
    await cache.find_next()  # the robot is on air: every second, each list changes
    link, now = cache.connect(), datetime.now(UTC)
    page = now.replace(minute=now.minute // 10 * 10).strftime("%Y-%m-%dT%H:%MZ")
    below = ("", f"/public/{now:%Y-%m-%d}", f"/public/{page}", f"/public/{page}/keys")
    before = {path: (await link.ask(f"{ROBOT}/past{path}")).headers["etag"] for path in below}
    pause_s = time.time() + LIST_S
    await until_async("the pause is over", lambda: time.time() // LIST_S > pause_s // LIST_S, 3 * LIST_S)
    relay = Link(int(cache.origin.address.rpartition(":")[2]))
    for path, etag in before.items():
        if (await relay.ask(f"{ROBOT}/past{path}")).headers["etag"] == etag:
            continue  # these ten minutes have ended meanwhile
        crowd = await asyncio.gather(*(cache.connect().ask(f"{ROBOT}/past{path}") for _ in range(CROWD)))
        assert {answer.status for answer in crowd} == {200}
        assert etag not in {answer.headers["etag"] for answer in crowd}, path


async def test_what_has_left_the_window_is_gone_from_the_cache_as_well(cache: Cache) -> None:
    link, relay = cache.connect(), Link(int(cache.origin.address.rpartition(":")[2]))
    path = await cache.find_next()
    answer = await link.ask(path)
    fresh_s = int(answer.headers["cache-control"].partition("max-age=")[2])
    assert 0 < fresh_s < PAST_S
    reckoned_s: list[
        float
    ] = []  # what the time is, as a page reckons it by an answer that was kept for a while
    while (await relay.ask(path)).is_segment:
        if (answer := await link.ask(path)).is_segment:
            sent_s = parsedate_to_datetime(answer.headers["date"]).timestamp()
            reckoned_s.append(sent_s + int(answer.headers.get("age", 0)))
        await asyncio.sleep(0.1)
    assert reckoned_s[-1] - reckoned_s[0] >= PAST_S / 3
    for one in (relay, link):  # in the cache a second or two later: it counts whole ones
        for _ in range(30):
            if not (answer := await one.ask(path)).is_segment:
                break
            await asyncio.sleep(0.1)
        assert not answer.is_segment
        assert answer.headers["cache-control"] == "public, max-age=1"


async def test_a_crowd_in_a_blackout_asks_the_relay_as_one_and_hears_at_once_when_it_ends(
    cache: Cache, world: World
) -> None:
    """A cache that repeats the 404 while one request is held would keep all others in the dark meanwhile."""
    async with play_crowd(cache) as crowd:
        await until_async("all follow", lambda: all(len(one.got) >= 2 for one in crowd))
        world.set_blackout(True)
        try:
            await until_async("it is dark for all", lambda: all(len(one.refused) >= 4 for one in crowd))
            asked, began_s = len(cache.origin.asked), asyncio.get_running_loop().time()
            before = [len(one.refused) for one in crowd]
            again = lambda: all(len(one.refused) >= n + 3 for one, n in zip(crowd, before, strict=True))  # noqa: E731
            await until_async("they ask again", again)
            spent_s = asyncio.get_running_loop().time() - began_s
            asked = len(cache.origin.asked) - asked
            had = [len(one.got) for one in crowd]
        finally:
            world.set_blackout(False)
        goes_on = lambda: all(len(one.got) >= n + 2 for one, n in zip(crowd, had, strict=True))  # noqa: E731
        await until_async("it goes on", goes_on)
    print(f"{asked} requests in {spent_s:.1f} s of a blackout")
    assert asked <= 2 * (spent_s + 1)  # they wait for one of two names
    for one in crowd:
        assert len(set(one.got)) == len(one.got)
        for answer in one.refused:
            assert answer.status == 404
            assert set(json.loads(answer.body)) == {"error"}
            assert answer.headers["cache-control"] == "public, max-age=1"
            assert answer.headers.items() >= CONTACT.items()
            assert answer.headers.get("x-cache") in {"MISS", "HIT", "EXPIRED"}


async def test_nobody_hears_of_a_blackout_while_one_is_held_for_what_follows_it(
    cache: Cache, world: World
) -> None:
    """The cache has an old 404 under the name of the next segment, for which one request is at the relay."""
    follower = Follower(cache.connect())
    following = asyncio.create_task(follower.follow())
    await until_async("it follows", lambda: len(follower.got) >= 2)
    world.set_blackout(True)
    try:
        await until_async("it is dark", lambda: len(follower.refused) > 0)
        world.edge.process.send_signal(signal.SIGSTOP)
        world.set_blackout(False)
        relay = Link(int(cache.origin.address.rpartition(":")[2]))
        while (await relay.ask(f"{ROBOT}/past?view=public")).status != 200:
            await asyncio.sleep(0.02)
        before = len(cache.origin.asked)
        held = lambda: len(cache.origin.asked) > max(before, len(cache.origin.answered))  # noqa: E731
        await until_async("one is held", held)
        take, index = follower.got[-1]
        other = cache.connect()
        await other.send(f"{ROBOT}/past/public/{take}/{index + 1}")
    finally:
        world.set_blackout(False)
        world.edge.process.send_signal(signal.SIGCONT)
        following.cancel()
    # The robot returns before the hold is over: by then its past may have left the window, which is also a
    # 404.
    assert (await other.receive()).status in {200, 204}


async def test_a_range_is_not_answered_with_a_part(cache: Cache) -> None:
    path = await cache.find_next()
    for link in (cache.connect(), cache.connect()):
        answer = await link.ask(path, range="bytes=0-9")
        assert (answer.status, len(answer.body) > 10) == (200, True)


async def test_a_token_is_refused_as_something_that_nobody_may_keep(cache: Cache, world: World) -> None:
    shown = {"authorization": f"Bearer {world.token}"}
    refused = await cache.connect().ask(f"{ROBOT}/past/public/{0:016x}/0", **shown)
    assert refused.status == 404
    assert refused.headers["cache-control"] == "private, no-store"
    assert set(json.loads(refused.body)) == {"error"}


async def test_a_relay_that_does_not_answer_is_asked_by_few(cache: Cache) -> None:
    path = await cache.find_next()
    cache.origin.refuses = True
    answers = await asyncio.gather(*(cache.connect().ask(path) for _ in range(50)))
    assert {answer.status for answer in answers} <= {502, 503}
    for answer in answers:
        assert set(json.loads(answer.body)) == {"error"}
        said = answer.headers
        assert said["content-type"] == "application/json"
        assert (said["cache-control"], said["retry-after"]) == ("public, max-age=1", "1")
        assert said.items() >= CONTACT.items()
    assert len(cache.origin.asked) <= 5
    cache.origin.refuses = False
    link = cache.connect()
    for _ in range(100):
        if (answer := await link.ask(path)).status == 200:
            break
        await asyncio.sleep(0.1)
    assert answer.is_segment
