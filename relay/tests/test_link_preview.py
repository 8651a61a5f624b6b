"""What a chat is told of a link: only what anyone may see, and no address that a request names."""

from __future__ import annotations

import html
import re
from pathlib import Path
from typing import Any

import httpx
import pytest
from posecast_testing import until
from posecast_wire import Schema, build_schema_text

from .pictures import make_png
from .stage import Model

INDEX = (
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


class Pictured(Model):
    """A model with a small picture."""

    def __init__(self, picture: bytes, type_: str = "image/png") -> None:
        super().__init__({"small.png": (picture, type_)}, thumbnail="small.png")


def read_tags(page: str) -> dict[str, str]:
    found = re.findall(r'<meta (?:property|name)="([^"]*)" content="([^"]*)"', page)
    return {name: html.unescape(text) for name, text in found}


@pytest.fixture
def start(relays: Any, tmp_path: Path) -> Any:
    """A relay with a robot for anyone, one for anyone on some pages, and one for those with a link."""
    folder = tmp_path / "page"
    folder.mkdir()
    (folder / "index.html").write_text(INDEX)
    robots = tmp_path / "robots.toml"
    robots.write_text(
        "[robots.open.anyone]\n[robots.course.anyone]\nframes=['https://course.example']\n[robots.lab.link]\n"
    )
    robots.chmod(0o600)
    return lambda *flags: relays("--dev", "--static", str(folder), "--robots", str(robots), *flags)


def test_a_chat_sees_who_anyone_may_see_and_of_others_the_general_words(
    start: Any, edges: Any, tmp_path: Path
) -> None:
    relay = start("--public-url", AT + "/")
    model = Pictured(SMALL)
    edges(relay.zenoh, robot="open", of=named(EVIL), model=model)
    edges(relay.zenoh, robot="lab", of=named("secret"), model=model)
    edges(relay.zenoh, robot="course", of=named(PERSIAN))
    base = f"http://{relay.address}"

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

    robots = tmp_path / "robots.toml"
    robots.write_text(robots.read_text().replace("[robots.lab.link]", "[robots.lab.anyone]"))
    until("it was hidden, and is not now", lambda: "secret" in page("/r/lab"))


def test_without_an_address_of_its_own_a_relay_makes_no_whole_ones(start: Any, edges: Any) -> None:
    relay = start()
    edges(relay.zenoh, robot="open", of=named("Otto"), model=Pictured(SMALL))
    base = f"http://{relay.address}"
    until("a picture", lambda: "/picture" in httpx.get(f"{base}/r/open").text)
    page = httpx.get(f"{base}/r/open", headers={"host": "evil.example"}).text
    tags = read_tags(page)
    assert tags["og:image"] == "../api/v1/robots/open/picture"
    assert "og:url" not in tags
    assert "oembed" not in page
    assert "evil.example" not in page
    assert httpx.get(f"{base}/api/v1/oembed", params={"url": f"{base}/r/open"}).status_code == 404


def test_a_picture_that_the_relay_does_not_serve_is_not_named(start: Any, edges: Any, tmp_path: Path) -> None:
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
    (tmp_path / "robots.toml").write_text("".join(f"[robots.{robot}.anyone]\n" for robot in pictures))
    relay = start("--public-url", AT)
    for robot, (picture, type_, _) in pictures.items():
        edges(relay.zenoh, robot=robot, of=named("Otto"), model=Pictured(picture, type_))
    base = f"http://{relay.address}"
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
