"""The built guide: complete, small, self-contained, and faithful to the Markdown."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections import Counter
from hashlib import sha256
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from markdown_it import MarkdownIt

from tools.site.__main__ import SiteError, build, change_script
from tools.site.navigation import make_navigation
from tools.site.python_page import write_python_page
from tools.site.routes_page import read_description, write_routes
from tools.site.staging import MOVED, indent_lists, stage_pages

pytestmark = pytest.mark.docs

ROOT = Path(__file__).resolve().parent.parent
BYTES_PER_PAGE = 64_000  # with its share of pictures, scripts and search; without recordings and their player
# what a page loads by itself, when it is opened
LOADED = {"script": "src", "link": "href", "img": "src", "source": "srcset", "iframe": "src", "video": "src"}
COUNTED = ("table", "tr", "li", "pre", "h1", "h2", "h3", "h4", "img", "blockquote")
STYLE_URL = re.compile(r"url\(([^)]*)\)")


class Page(HTMLParser):
    """The parts of one built page."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.ids: set[str] = set()
        self.inline: list[str] = []
        self.elements: Counter[str] = Counter()
        self._in_article = False
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        if "id" in given:
            self.ids.add(given["id"])
        if (name := LOADED.get(tag)) in given and given.get("rel") not in ("next", "prev", "canonical"):
            self.loads.append(given[str(name)])
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        is_data = given.get("type") == "application/json"
        if tag == "style" or "style" in given or (tag == "script" and "src" not in given and not is_data):
            self.inline.append(f"<{tag}>")
        self.inline += [f"<{tag} {name}>" for name in given if name.startswith("on")]
        if tag == "article":
            self._in_article = True
        if self._in_article:
            is_note = "admonition" in given.get("class", "").split()
            self.elements["blockquote" if is_note else tag] += 1  # as GitHub's `> [!NOTE]` is written

    def handle_endtag(self, tag: str) -> None:
        if tag == "article":
            self._in_article = False


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    return {file: Page(file) for file in sorted(site.rglob("*.html"))}


def find_file(site: Path, page: Path, target: str) -> Path:
    """The file behind a link within the site."""
    found = (page.parent / unquote(urlsplit(target).path)).resolve() if urlsplit(target).path else page
    assert found.is_relative_to(site.resolve()), f"{page.name}: {target} leads out of the site"
    return found / "index.html" if found.is_dir() else found


def is_of_recordings(site: Path, file: Path) -> bool:
    """Whether a file is no page of the guide, but of what its gallery shows."""
    return file.is_relative_to(site / "gallery")


def test_it_is_small_and_has_every_page(site: Path) -> None:
    files = [file for file in site.rglob("*") if file.is_file() and not is_of_recordings(site, file)]
    size, count = sum(file.stat().st_size for file in files), len([*site.rglob("*.html")])
    assert size <= BYTES_PER_PAGE * count, f"{size} bytes in {count} pages: shrink one or raise the limit"
    names = {file.relative_to(site).as_posix() for file in files}
    written = {path.relative_to(ROOT / "docs") for path in (ROOT / "docs").rglob("*.md")}
    written |= {Path(place) for place in (*MOVED.values(), "reference/routes.md", "reference/python-api.md")}
    assert {path.with_suffix(".html").as_posix() for path in written} <= names
    assert "404.html" in names


def test_nothing_comes_from_elsewhere(site: Path, pages: dict[Path, Page]) -> None:
    for file, page in pages.items():
        assert page.loads
        for target in page.loads:
            assert not urlsplit(target).scheme, f"{file.name} loads {target}"
            assert not target.startswith("/"), (
                f"{file.name} loads {target}, so works at the root of a host only"
            )
            assert find_file(site, file, target).is_file(), f"{file.name} loads {target}"
    for style in site.rglob("*.css"):
        for target in STYLE_URL.findall(style.read_text(encoding="utf-8")):
            assert target.strip("\"'").startswith("data:"), f"{style.name} loads {target}"
        assert "@import" not in style.read_text(encoding="utf-8")


def test_a_strict_content_policy_suffices(site: Path, pages: dict[Path, Page]) -> None:
    """A recording's page brings a policy of its own, with the hash of its script."""
    inline = {file: page.inline for file, page in pages.items() if page.inline}
    assert {file.name: tags for file, tags in inline.items() if not is_of_recordings(site, file)} == {}
    for file, tags in inline.items():
        assert tags == ["<script>"]
        text = file.read_text(encoding="utf-8")
        script = text.partition("<script>")[2].partition("</script>")[0]
        assert b64encode(sha256(script.encode()).digest()).decode() in text.partition("<script>")[0]


def test_another_script_than_was_expected_is_refused(tmp_path: Path) -> None:
    script = tmp_path / "assets/javascripts/bundle.1a2b3c4d.min.js"
    script.parent.mkdir(parents=True)
    (tmp_path / "search.json").write_text("{}")
    script.write_text(
        'o.appendChild(C("style",{},Tc.toString()));'
        'C("nav",{class:"md-code__nav"},C("nav",{class:"md-tabs"}));'
        'return location.protocol==="file:"?ct(`${new URL("search.js",b)}`):Ge(new URL("search.json",b));'
    )
    change_script(tmp_path)
    assert script.read_text() == (
        "(s=>{s.replaceSync(Tc.toString());o.adoptedStyleSheets=[s]})(new CSSStyleSheet);"
        'C("div",{class:"md-code__nav"},C("nav",{class:"md-tabs"}));'
        'return !0?ct(`${new URL("search.js",b)}`):Ge(new URL("search.json",b));'
    )
    assert not (tmp_path / "search.json").exists()
    with pytest.raises(ValueError, match=r"bundle\.1a2b3c4d\.min\.js: 0 of"):
        change_script(tmp_path)


def test_every_link_and_anchor_leads_somewhere(site: Path, pages: dict[Path, Page]) -> None:
    checked = 0
    for file, page in pages.items():
        for target in page.links:
            if urlsplit(target).scheme:
                continue
            found = find_file(site, file, target)
            assert found.is_file(), f"{file.relative_to(site)}: {target}"
            anchor = unquote(urlsplit(target).fragment)
            if anchor and found in pages:
                assert anchor in pages[found].ids, f"{file.relative_to(site)}: {target}"
            checked += 1
    assert checked > 1000


def test_every_page_can_be_reached_and_found(site: Path, pages: dict[Path, Page]) -> None:
    home = site / "index.html"
    reached, ahead = {home}, [home]
    while ahead:
        file = ahead.pop()
        for target in pages[file].links:
            found = find_file(site, file, target) if not urlsplit(target).scheme else file
            if found in pages and found not in reached:
                reached.add(found)
                ahead.append(found)
    recorded = {file for file in pages if is_of_recordings(site, file)}
    assert pages.keys() - reached - recorded == {site / "404.html"}
    reached -= recorded
    script = (site / "search.js").read_text(encoding="utf-8")  # since from files nothing can be fetched
    index = json.loads(script.removeprefix("var __index = ").rstrip(";\n"))
    found_pages = {item["location"].partition("#")[0] for item in index["items"]}
    assert {file.relative_to(site).as_posix() for file in reached} <= found_pages


def test_a_page_shows_what_its_markdown_says(
    site: Path, pages: dict[Path, Page], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on GitHub: the generator has its own rules about indented lists."""
    monkeypatch.setattr("tools.site.staging.indent_lists", lambda text: text)
    stage_pages(ROOT, tmp_path / "docs")
    markdown = MarkdownIt("commonmark").enable("table")
    other: dict[str, dict[str, tuple[int, int]]] = {}
    for source in sorted((tmp_path / "docs").rglob("*.md")):
        name = source.relative_to(tmp_path / "docs").with_suffix(".html")
        text = re.sub(r"\A---\n.*?\n---\n", "", source.read_text(encoding="utf-8"), flags=re.DOTALL)
        shown, meant = pages[site / name].elements, Counter[str]()
        meant.update(re.findall(r"<(\w+)", markdown.render(text)))
        meant["img"] += text.count('<div class="moment"')  # its poster
        faults = {tag: (meant[tag], shown[tag]) for tag in COUNTED if meant[tag] != shown[tag]}
        if faults:
            other[str(name)] = faults
    assert other == {}, "tag: (meant, shown)"


def test_lists_are_indented_for_the_generator() -> None:
    page = (
        "Words:\n- a\n  more\nlazy\n  - b\n\n"
        "1. one\n\n   ```sh\n   run\n     deep\n   ```\n10. ten\n    ten\n"
    )
    shown = (
        "Words:\n\n- a\n    more\nlazy\n    - b\n\n"
        "1. one\n\n    ```sh\n    run\n      deep\n    ```\n\n10. ten\n    ten\n"
    )
    assert indent_lists(page) == shown
    assert indent_lists("```\n- no\n  list\n```\n") == "```\n- no\n  list\n```\n"


def test_a_link_to_nowhere_ends_the_build(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stage_one(_: Path, out: Path) -> None:
        (out / "reference").mkdir(parents=True)
        (out / "index.md").write_text("# Home\n\n[gone](reference/gone.md)\n", encoding="utf-8")

    monkeypatch.setattr("tools.site.__main__.stage_pages", stage_one)
    with pytest.raises(SiteError, match=r"reference/gone\.md"):
        build(tmp_path / "site")
    assert not (tmp_path / "site").exists()


def test_links_follow_a_page_that_moves(tmp_path: Path) -> None:
    root, out = tmp_path / "root", tmp_path / "out"
    (root / "docs/how-to").mkdir(parents=True)
    (root / "infra").mkdir()
    (root / "infra/relay.service").write_text("[Unit]")
    for name in (*MOVED, "README.md"):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text("[a](docs/how-to/run.md#x)" if name == "CHANGELOG.md" else "")
    page = root / "docs/how-to/run.md"
    page.write_text(
        "[w](../../wire/SPEC.md#x) [f](../../infra/relay.service) [h](../../README.md) [s](#y) "
        '<img src="a.png">'
    )
    (root / "docs/how-to/a.png").write_text("")
    stage_pages(root, out)
    assert (out / "how-to/run.md").read_text() == (
        "[w](../reference/wire-format.md#x) [f](../files/infra/relay.service) [h](../index.md) [s](#y) "
        '<img src="a.png">'
    )
    assert (out / "files/infra/relay.service").read_text() == "[Unit]"
    assert (out / "project/changelog.md").read_text() == "[a](../how-to/run.md#x)"


def test_the_image_is_built_of_all_that_the_guide_is_made_of(site: Path) -> None:
    lines = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    copied = [line[1:] for line in lines if line.startswith("!")]
    linked = [path.relative_to(site / "files").as_posix() for path in (site / "files").rglob("*.*")]
    assert linked
    for name in (*linked, *MOVED, "docs/index.md", "zensical.toml", "tools/site/__main__.py"):
        assert any(name == each or name.startswith(f"{each}/") for each in copied), f"{name} is left out"


def test_pages_are_listed_by_their_folder(tmp_path: Path) -> None:
    for name, title in (
        ("index.md", "Home"),
        ("how-to/robots/ros2.md", "ROS 2"),
        ("how-to/robots/add-a-robot.md", "Add a robot"),
        ("how-to/watch/share.md", "Share"),
        ("tutorials/find-the-fault.md", "Find"),
        ("tutorials/first-robot.md", "First"),
        ("SECURITY.md", "Security"),
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(f"# {title}\n")
    assert make_navigation(tmp_path) == [
        {"Home": "index.md"},
        {"Tutorials": ["tutorials/first-robot.md", "tutorials/find-the-fault.md"]},
        {
            "How-to guides": [
                {"Robots": ["how-to/robots/add-a-robot.md", "how-to/robots/ros2.md"]},
                {"Watch": ["how-to/watch/share.md"]},
            ]
        },
        {"Explanation": ["SECURITY.md"]},
    ]


def test_the_generated_pages_have_what_they_are_about() -> None:
    python = write_python_page(ROOT)
    assert "## `posecast.Robot`" in python
    assert "### `publish()`" in python
    assert "wrong: NoReturn" not in python
    routes = write_routes(read_description())
    for route in ("GET /api/v1/robots", "GET /api/v1/robots/{robot}/past", "GET /api/v1/admin"):
        assert f"\n\n`{route}`" in routes
    assert "[RobotState](#robotstate)" in routes
    assert "### RobotState\n" in routes
    assert "any value" not in routes
    for heading in re.findall("^#+ (.*)", routes, re.MULTILINE):
        assert heading.count("(") == heading.count(")"), heading
