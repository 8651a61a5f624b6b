"""The page at addresses without `#`: of robots, and of nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import pytest
from posecast_relay.http.previews import find_home, place_page, read_robots

from .stage import SharedRelay

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


def test_a_robots_path_is_the_page_and_a_mistyped_one_the_page_with_404(relays: Any, tmp_path: Path) -> None:
    folder = tmp_path / "page"
    folder.mkdir()
    (folder / "index.html").write_text(INDEX)
    robots = tmp_path / "robots.toml"
    robots.write_text("[robots.open.anyone]\n[robots.lab.link]\n")
    robots.chmod(0o600)
    base = f"http://{relays('--static', str(folder), '--robots', str(robots)).address}"

    def ask(path: str, **headers: str) -> httpx.Response:
        return httpx.get(base + path, headers=headers)

    for headers in ({}, A_BROWSER):  # a chat that shows the link asks for anything
        hidden, absent = ask("/r/lab", **headers), ask("/r/no-such", **headers)
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
    for path in ("/api/v1/nothing", "/api/v1/robots/lab", "/api", "/livez/x"):
        assert ask(path, **A_BROWSER).status_code == 404, path
    assert "error" in ask("/api/v1/nothing", **A_BROWSER).json()
    assert httpx.post(base + "/r/demo").status_code == 405
    assert httpx.head(base + "/r/demo").status_code == 200
    (folder / "index.html").unlink()
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
