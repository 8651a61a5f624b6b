"""What a chat is told of a link: only what anyone may see, and no address that a request names."""

from __future__ import annotations

import asyncio
import html
import re
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import pytest
from posecast_relay.http.previews import (
    LOADING_MAX,
    PICTURE_BYTES_MAX,
    Thumbnails,
    find_home,
    place_page,
    read_robots,
)
from posecast_relay.kit import REFUSED_S
from posecast_relay.models.cache import RETRY_S, Absent, ModelCache, Unavailable
from posecast_relay.models.memory import ENTRY_BYTES
from posecast_testing import until
from posecast_wire import Schema, build_schema_text

from .pictures import make_png
from .stage import Model, Relay, SharedRelay
from .test_model_cache import MB, Edge, sha256

CARD = (
    '<!doctype html><html lang="en"><head><title>Posecast</title>'
    '<meta property="og:title" content="Posecast" /><meta property="og:image" content="./icon-512.png" />'
    "</head></html>"
)
PERSIAN = "Course نیم\u200cساق\u200f"  # written with a joiner
EVIL = "Otto</title><script>alert('1')</script>\"\u202e"
SMALL = make_png(5, 3)
AT = "https://robots.example/lab"


def named(name: str) -> Schema:
    fields: list[dict[str, object]] = [{"name": "pos", "labels": "joint", "unit": "rad", "scale": 0.01}]
    return Schema.parse(build_schema_text(name, {"joint": ["RKN"]}, fields))


class PicturedModel(Model):
    """A model with a small picture."""

    def __init__(self, picture: bytes, type_: str = "image/png") -> None:
        super().__init__({"small.png": (picture, type_)}, thumbnail="small.png")


def read_tags(page: str) -> dict[str, str]:
    found = re.findall(r'<meta (?:property|name)="([^"]*)" content="([^"]*)"', page)
    return {name: html.unescape(text) for name, text in found}


ROBOTS = (
    "[robots.course.anyone]\nframes=['https://course.example']\n[robots.lab.link]\n[robots.dark.link]\n"
    + "".join(f"[robots.{robot}.anyone]\n" for robot in ("open", "html", "huge", "text"))
)


class Place(Relay):
    """A relay with robots for anyone, one for anyone on some pages, and two for those with a link."""

    def __init__(self, folder: Path, *flags: str) -> None:
        self.page, self.robots = folder / "page", folder / "robots.toml"
        self.page.mkdir()
        self.robots.write_text(ROBOTS)
        self.robots.chmod(0o600)
        self.write(CARD)
        super().__init__(folder, "--static", str(self.page), "--robots", str(self.robots), *flags)

    def write(self, index: str) -> None:
        """Another page."""
        (self.page / "index.html").write_text(index)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    """With an address of its own."""
    place = Place(tmp_path_factory.mktemp("place"), "--public-url", AT + "/")
    yield place
    place.stop()
    assert "Traceback" not in place.errors(), place.errors()


def test_a_chat_sees_who_anyone_may_see_and_of_others_the_general_words(place: Place, edges: Any) -> None:
    place.write(CARD)
    model = PicturedModel(SMALL)
    edges(place.zenoh, robot="open", of=named(EVIL), model=model)
    edges(place.zenoh, robot="lab", of=named("secret"), model=model)
    edges(place.zenoh, robot="course", of=named(PERSIAN))
    base = place.base

    def page(path: str, **headers: str) -> str:
        return httpx.get(base + path, headers=headers).text

    until("a model", lambda: "/picture" in page("/r/open"))
    until("another", lambda: PERSIAN in page("/r/course"))
    told = page("/r/open", host="evil.example")
    tags = read_tags(told)
    assert "<script>" not in told
    assert "evil.example" not in told
    assert "\u202e" not in told
    assert tags["og:title"].startswith("Otto</title><script>alert('1')")
    assert tags["og:image"] == f"{AT}/api/v1/robots/open/picture"
    assert (tags["og:image:width"], tags["og:image:height"]) == ("5", "3")
    assert tags["og:url"] == f"{AT}/r/open"
    assert tags["twitter:card"] == "summary"
    assert told.count("og:title") == 1
    oembed = re.findall(r'application/json\+oembed" href="([^"]*)"', told)
    assert oembed == [f"{AT}/api/v1/oembed?url=https%3A%2F%2Frobots.example%2Flab%2Fr%2Fopen"]
    general = page("/r/no-such")
    assert read_tags(general) == {"og:title": "Posecast", "og:image": f"{AT}/icon-512.png"}
    for hidden in ("/r/lab", "/r/open+lab", "/r/never-heard"):
        assert page(hidden) == general, hidden
    both = read_tags(page("/r/course+open"))
    assert both["og:title"].startswith(f"{PERSIAN}, Otto")
    assert both["og:image"] == tags["og:image"]

    picture = httpx.get(f"{base}/api/v1/robots/open/picture")
    assert (picture.content, picture.headers["content-type"]) == (SMALL, "image/png")
    assert picture.headers["cache-control"] == "public, max-age=60"
    assert picture.headers["access-control-allow-origin"] == "*"
    hidden_picture = httpx.get(f"{base}/api/v1/robots/lab/picture")
    absent = httpx.get(f"{base}/api/v1/robots/no-such/picture")
    assert (hidden_picture.status_code, hidden_picture.text) == (absent.status_code, absent.text)
    assert absent.status_code == 404

    def oembed_of(url: str, **more: str) -> httpx.Response:
        return httpx.get(f"{base}/api/v1/oembed", params={"url": url, **more})

    for address in (f"{AT}/r/open", f"{AT}/#/r/open?shown=both", f"{AT}/r/open#/r/open"):
        rich = oembed_of(address, maxwidth="400", maxheight="zero").json()
        assert (rich["type"], rich["width"], rich["height"]) == ("rich", 400, 250), address
        assert f'src="{AT}/embed/open"' in rich["html"]
        assert "<script>" not in rich["html"]
        assert rich["thumbnail_url"] == tags["og:image"]
        assert (rich["thumbnail_width"], rich["thumbnail_height"]) == (5, 3)
    assert oembed_of(f"{AT}/r/course").json()["type"] == "link", "not every page may frame it"
    for other in (f"{AT}/r/lab", f"{AT}/r/no-such", f"{AT}/r/open+course", "https://evil.example/r/open", AT):
        assert oembed_of(other).status_code == 404, other
    assert oembed_of(f"{AT}/r/open", format="xml").status_code == 501
    for none in (httpx.get(f"{base}/api/v1/oembed"), oembed_of("")):
        assert (none.status_code, none.json()) == (400, {"error": "give url=, the address of a robot's page"})

    place.robots.write_text(ROBOTS.replace("[robots.lab.link]", "[robots.lab.anyone]"))
    until("it was hidden, and is not now", lambda: "secret" in page("/r/lab"))


def test_without_an_address_of_its_own_a_relay_makes_no_whole_ones(relay: SharedRelay, edges: Any) -> None:
    (relay.page / "index.html").write_text(CARD)
    edges(relay, of=named("Otto"), model=PicturedModel(SMALL))
    base, robot = relay.base, relay.robot
    until("a picture", lambda: "/picture" in httpx.get(f"{base}/r/{robot}").text)
    page = httpx.get(f"{base}/r/{robot}", headers={"host": "evil.example"}).text
    tags = read_tags(page)
    assert tags["og:image"] == f"../api/v1/robots/{robot}/picture"
    assert "og:url" not in tags
    assert "oembed" not in page
    assert "evil.example" not in page
    assert httpx.get(f"{base}/api/v1/oembed", params={"url": f"{base}/r/{robot}"}).status_code == 404


def test_a_picture_that_the_relay_does_not_serve_is_not_named(place: Place, edges: Any) -> None:
    place.write(CARD)
    invalid = "the picture in this model can't be shown: "
    pictures = {
        "html": (b"<script>alert(1)</script>", "image/png", f"{invalid}not a valid image/png"),
        "huge": (
            make_png(50_000, 50_000),
            "image/png",
            f"{invalid}50000 × 50000 px; want 1 to 2048 for each side",
        ),
        "text": (SMALL, "text/plain", "no picture in this model"),
    }
    for robot, (picture, type_, _) in pictures.items():
        edges(place.zenoh, robot=robot, of=named("Otto"), model=PicturedModel(picture, type_))
    base = place.base
    for robot, (_, _, says) in pictures.items():
        api = f"{base}/api/v1/robots/{robot}"
        until("a model", lambda api=api: httpx.get(api).json().get("model"))  # type: ignore[misc]
        answer = httpx.get(f"{api}/picture")
        assert (answer.status_code, answer.json()) == (404, {"error": says})
        tags = read_tags(httpx.get(f"{base}/r/{robot}").text)
        assert (tags["og:title"], tags["og:image"]) == ("Otto", f"{AT}/icon-512.png")
        oembed = httpx.get(f"{base}/api/v1/oembed", params={"url": f"{AT}/r/{robot}"}).json()
        assert oembed["title"] == "Otto"
        assert "thumbnail_url" not in oembed


# ---- the small picture of a model: checked once, and given only where it can be served ----


class PicturedEdge(Edge):
    """A source of a model with a picture."""

    def __init__(self, picture: bytes, type_: str = "image/png", **more: Any) -> None:
        listed = [{"path": "p.png", "size": len(picture), "sha256": sha256(picture), "type": type_}]
        super().__init__({"p.png": picture}, {"v": 2, "files": listed, "thumbnail": "p.png", **more})


def make(edge: Edge) -> tuple[Thumbnails, ModelCache, SimpleNamespace]:
    clock = SimpleNamespace(now=0.0)
    models = ModelCache(edge, 10 * MB, lambda: clock.now)
    return Thumbnails(models, lambda: clock.now), models, clock


async def test_a_picture_that_is_one_is_found_with_its_size() -> None:
    edge = PicturedEdge(SMALL)
    thumbnails, models, _ = make(edge)
    assert await thumbnails.find_size("r", edge.digest, 0.0) is None, "it has to come first"
    found = await thumbnails.load_picture("r", edge.digest)
    assert models.find_data(found.name) == SMALL
    assert await thumbnails.find_size("r", edge.digest, 0.0) == (5, 3)
    assert edge.asked_for(SMALL) == [0]


@pytest.mark.parametrize(
    ("picture", "type_", "why"),
    [
        (b"<script>alert(1)</script>", "image/png", "can't be shown: not a valid image/png"),
        (make_png(50_000, 50_000), "image/png", "can't be shown: 50000 × 50000 px; want 1 to 2048"),
        (SMALL, "image/jpeg", "can't be shown: not a valid image/jpeg"),
        (SMALL, "text/html", "no picture in this model"),
        (bytes(PICTURE_BYTES_MAX + 1), "image/png", "no picture in this model"),
    ],
    ids=["html", "huge", "another type", "no type of a picture", "too many bytes"],
)
async def test_what_is_no_small_picture_is_refused_in_a_line_and_fetched_once(
    picture: bytes, type_: str, why: str
) -> None:
    edge = PicturedEdge(picture, type_)
    thumbnails, models, clock = make(edge)
    for _ in range(3):
        with pytest.raises(Absent, match=why):
            await thumbnails.load_picture("r", edge.digest)
        assert await thumbnails.find_size("r", edge.digest, 5.0) is None
        clock.now += 100 * REFUSED_S
        # what is kept has to go, and what was found out stays
        claim = models.room.claim("r", 10 * MB - ENTRY_BYTES, lambda: None)
        assert claim is not None
        models.room.release(claim)
        assert models.find_data(sha256(picture)) is None
    assert len(edge.asked_for(picture)) == ("can't be shown" in why)


async def test_nobody_waits_twice_for_a_robot_that_does_not_answer() -> None:
    edge = PicturedEdge(SMALL)

    def away(_answer: bytes) -> bytes:
        raise Unavailable("the edge does not answer: timeout")

    edge.spoil = away
    thumbnails, _, clock = make(edge)
    for _ in range(3):
        assert await thumbnails.find_size("r", edge.digest, 5.0) is None
    assert edge.asked == [("manifest", 0)]
    edge.spoil = lambda answer: answer
    clock.now += max(REFUSED_S, RETRY_S)
    assert await thumbnails.find_size("r", edge.digest, 5.0) == (5, 3)


async def test_a_slow_one_comes_for_who_asks_later() -> None:
    edge, let = PicturedEdge(SMALL), asyncio.Event()
    fetch = edge.fetch_manifest

    async def slow(_robot: str, _digest: str) -> bytes:
        await let.wait()
        return await fetch(_robot, _digest)

    edge.fetch_manifest = slow  # type: ignore[method-assign]
    thumbnails, _, clock = make(edge)
    first = asyncio.create_task(thumbnails.find_size("r", edge.digest, 5.0))
    await asyncio.sleep(0)
    clock.now += 5.0
    assert await thumbnails.find_size("r", edge.digest, 5.0) is None, "its time has passed"
    assert not first.done()
    let.set()
    assert await first == (5, 3)
    assert await thumbnails.find_size("r", edge.digest, 0.0) == (5, 3)


async def test_only_so_many_are_under_way() -> None:
    edge = PicturedEdge(SMALL)
    never = asyncio.Event()

    async def stuck(_robot: str, _digest: str) -> bytes:
        await never.wait()
        raise AssertionError

    edge.fetch_manifest = stuck  # type: ignore[method-assign]
    thumbnails, _, _ = make(edge)
    before = len(asyncio.all_tasks())
    for n in range(2 * LOADING_MAX):
        assert await thumbnails.find_size(f"r{n}", edge.digest, 0.0) is None
    named = [task for task in asyncio.all_tasks() if task.get_name() == "picture"]
    assert len(named) == LOADING_MAX
    for task in named:
        task.cancel()
    await asyncio.gather(*named, return_exceptions=True)
    assert len(asyncio.all_tasks()) <= before + LOADING_MAX


# ---- the page at addresses without `#`: of robots, and of nothing --------------------


INDEX = (
    '<!doctype html>\n<html lang="en"><head><meta http-equiv="Content-Security-Policy" '
    'content="default-src &#39;self&#39;"><link href="./a.css"><title>page</title></head>'
    '<body data-href="./b"><script src="./a.js"></script></body></html>'
)
A_BROWSER = {"accept": "text/html,application/xhtml+xml,*/*;q=0.8"}


@pytest.mark.parametrize(
    ("path", "robots"),
    [
        ("/r/demo", ("demo",)),
        ("/r/demo/", ("demo",)),
        ("/r/left+right", ("left", "right")),
        ("/r/a+a", ("a",)),
        ("/r/a+b+c+d+e+f", ("a", "b", "c", "d", "e", "f")),
        ("/r/a+b+c+d+e+f+g", None),
        ("/r/", None),
        ("/r/Demo", None),
        ("/r/demo/x", None),
        ("/r/a++b", None),
        ("/demo", None),
        (f"/r/{'a' * 64}", None),
    ],
)
def test_a_path_names_robots_or_nothing(path: str, robots: tuple[str, ...] | None) -> None:
    assert read_robots(path) == robots


def test_the_page_is_told_how_many_folders_above_its_files_are() -> None:
    assert [find_home(path) for path in ("/x", "/r/demo", "/r/demo/", "//x")] == [
        "./",
        "../",
        "../../",
        "../",
    ]
    assert find_home("/" * 18) is None
    placed = place_page(INDEX, "../", "<meta more>")
    assert '<html data-home="../" lang="en">' in placed
    assert '<link href="../a.css">' in placed
    assert '<script src="../a.js">' in placed
    assert "<meta more></head>" in placed


def test_a_robots_path_is_the_page_and_a_mistyped_one_the_page_with_404(place: Place) -> None:
    place.write(INDEX)

    def ask(path: str, **headers: str) -> httpx.Response:
        return httpx.get(place.base + path, headers=headers)

    for headers in ({}, A_BROWSER):  # a chat that shows the link asks for anything
        hidden, absent = ask("/r/dark", **headers), ask("/r/no-such", **headers)
        assert hidden.status_code == 200
        assert 'data-home="../"' in hidden.text
        assert (hidden.text, hidden.status_code) == (absent.text, absent.status_code), "no robot is betrayed"
        assert hidden.headers["content-security-policy"] == "default-src 'self'; frame-ancestors 'none'"
        assert hidden.headers["x-frame-options"] == "DENY"
        assert hidden.headers["cache-control"] == "no-cache"
        assert ask("/r/a%2bb", **headers).status_code == 200
    for path in ("/demo", "/robots/demo", "/r/Demo", "/r/", "/%3Cscript%3E", "/r/a%2fb", "/index.htm"):
        page = ask(path, **A_BROWSER)
        assert page.status_code == 404, path
        assert "<title>page" in page.text, path
        assert "script>alert" not in page.text
        plain = ask(path)
        assert plain.json() == {"error": "Not Found"}, path
        assert [answer.headers["vary"] for answer in (page, plain)] == ["accept"] * 2, path
    deep = ask("/x" * 18, **A_BROWSER)
    assert (deep.status_code, deep.json()) == (404, {"error": "Not Found"})
    for path in ("/api/v1/nothing", "/api/v1/robots/dark", "/api", "/livez/x"):
        assert ask(path, **A_BROWSER).status_code == 404, path
    assert "error" in ask("/api/v1/nothing", **A_BROWSER).json()
    assert httpx.post(place.base + "/r/demo").status_code == 405
    assert httpx.head(place.base + "/r/demo").status_code == 200
    (place.page / "index.html").unlink()
    assert ask("/r/demo", **A_BROWSER).status_code == 404, "a page that is being built anew"


def test_no_path_leads_out_of_the_page_or_around_in_it(relay: SharedRelay) -> None:
    """A detour tells what folders there are; and by one, an index would be kept for a year."""
    folder = relay.page
    (folder / "assets").mkdir()
    (folder / "index.html").write_text(INDEX)
    (folder / "assets/a.js").write_text("1")
    (folder / "assets/..b.js").write_text("2")
    with httpx.Client(base_url=relay.base) as client:
        for path in (
            *("/..%2fpage%2findex.html", "/%2e%2e/page/index.html", "/assets/..%2findex.html"),
            *(
                "/assets/.%2fa.js",
                "/assets/%2fa.js",
                "/assets/a.js/",
                "/index.html/",
                "/%2e",
                "/assets/%2e%2e",
            ),
        ):
            target = client.build_request("GET", path)
            target.url = target.url.copy_with(raw_path=path.encode())  # as it stands here
            assert client.send(target).status_code == 404, path
        for path in ("/", "/index.html", "/assets/a.js", "/assets/..b.js"):
            assert client.get(path).status_code == 200, path
