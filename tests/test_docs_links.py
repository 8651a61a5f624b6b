"""Every relative link, anchor and picture on every page exists, and every file that some pages name."""

from __future__ import annotations

import re
import subprocess
import unicodedata
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path
from urllib.parse import unquote

import pytest
from markdown_it import MarkdownIt
from markdown_it.token import Token

pytestmark = pytest.mark.docs

ROOT = Path(__file__).resolve().parent.parent
LISTED = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"]
PAGES = sorted(
    path
    for name in subprocess.run(LISTED, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    if (path := ROOT / name).exists()
)
MARKDOWN = MarkdownIt("commonmark").enable("table")
HTML_ID = re.compile(r"""<[^>]*\b(?:id|name)=["']([^"']+)["']""")
HTML_LINK = re.compile(r"""<[^>]*\b(?:src|href)=["']([^"']+)["']""")


def slug(title: str) -> str:
    """GitHub's anchor of a heading, given without markup."""
    letters = re.sub(r"[^\w\- ]", "", unicodedata.normalize("NFC", title).lower().strip())
    return letters.replace(" ", "-")


def walk(tokens: list[Token]) -> Iterator[Token]:
    for token in tokens:
        yield token
        yield from walk(token.children or [])


@cache
def tokens(page: Path) -> list[Token]:
    return MARKDOWN.parse(page.read_text(encoding="utf-8"))


@cache
def anchors(page: Path) -> set[str]:
    """If a heading occurs twice, only the first counts: generators number the second differently."""
    blocks, found = tokens(page), set()
    for heading, inline in pairwise(blocks):
        if heading.type == "heading_open":
            text = "".join(t.content for t in inline.children or [] if t.type in ("text", "code_inline"))
            found.add(slug(text))
    for token in walk(blocks):
        if token.type in ("html_block", "html_inline"):
            found.update(HTML_ID.findall(token.content))
    return found


def targets(page: Path) -> Iterator[str]:
    for token in walk(tokens(page)):
        if token.type == "link_open":
            yield str(token.attrs["href"])
        elif token.type == "image":
            yield str(token.attrs["src"])
        elif token.type in ("html_block", "html_inline"):
            yield from HTML_LINK.findall(token.content)


def find_fault(page: Path, target: str) -> str | None:
    """Why a link is broken; None if it is fine or leads outside our files."""
    if re.match(r"[a-z][a-z0-9+.-]*:", target):
        return None
    name, _, anchor = unquote(target).partition("#")
    if name.startswith("/"):
        return "is not relative"
    file = (page.parent / name).resolve() if name else page
    if not file.is_relative_to(ROOT) or not file.exists():
        return "does not exist"
    if anchor and file.suffix == ".md" and anchor not in anchors(file):
        return "has no such heading"
    return None


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    faults = {target: fault for target in targets(page) if (fault := find_fault(page, target))}
    assert faults == {}, page.relative_to(ROOT)


def test_all_pages_are_checked() -> None:
    names = {str(path.relative_to(ROOT)) for path in PAGES}
    assert {
        "README.md",
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "wire/SPEC.md",
        "benches/peers/README.md",
    } <= names
    assert sum(len(list(targets(page))) for page in PAGES) > 100


@pytest.mark.parametrize(
    ("title", "anchor"),
    [
        ("Who may", "who-may"),
        ("§5 Frames: KEY, plain", "5-frames-key-plain"),
        ("posecast_edge & --flag", "posecast_edge----flag"),
        ("한국어 Übung", "한국어-übung"),
    ],
)
def test_anchors_are_githubs(title: str, anchor: str) -> None:
    assert slug(title) == anchor


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("[a](other.md)", "does not exist"),
        ("[a](#there)", "has no such heading"),
        ("[a](page.md#here)", None),
        ("[a](#here)", None),
        ('[a](#named) <a id="named"></a>', None),
        ("![p](img/p.webp)", "does not exist"),
        ('<img src="img/p.webp">', "does not exist"),
        ("[a](/docs/page.md)", "is not relative"),
        ("[a](../../outside.md)", "does not exist"),
        ("[a](https://example.org/x#y)", None),
        ("`[a](other.md)`", None),
    ],
)
def test_a_link_that_leads_nowhere_is_found(
    text: str, fault: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tests.test_docs_links.ROOT", tmp_path)
    page = tmp_path / "page.md"
    page.write_text(f"# Here\n\n{text}\n", encoding="utf-8")
    found = [find_fault(page, target) for target in targets(page)]
    assert [each for each in found if each] == ([fault] if fault else [])


# ---- files that pages name in their text: on architecture, on extending Posecast, on faults ----------

OVERVIEW = ROOT / "docs/ARCHITECTURE.md"
PARTS = ("edge-agent", "fault-isolation", "lane", "libraries-not-used", "relay", "rendering", "web-page")
NAMING = (
    OVERVIEW,
    *(ROOT / f"docs/explanation/{part}.md" for part in (*PARTS, "multiple-relays")),
    *sorted((ROOT / "docs/how-to/extend").glob("*.md")),
)
ROOTS = (
    ROOT,
    ROOT / "edge-agent/src/posecast_edge",
    ROOT / "relay/src/posecast_relay",
    ROOT / "spa/src",
    ROOT / "spa/src/stream/lane",
    ROOT / "wire",
)


def find_names(page: Path) -> list[str]:
    """The files and folders that a page names."""
    return re.findall(r"`([\w-][\w./-]*/(?:[\w.-]+\.\w+)?)`", page.read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", NAMING, ids=lambda page: page.stem)
def test_what_it_names_exists(page: Path) -> None:
    missing = [name for name in find_names(page) if not any((root / name).exists() for root in ROOTS)]
    assert missing == []


@pytest.mark.parametrize("page", NAMING, ids=lambda page: page.stem)
def test_a_source_file_that_it_names_without_a_folder_exists(page: Path) -> None:
    named = re.findall(r"`(\w+\.(?:py|tsx?|css))`", page.read_text(encoding="utf-8"))
    folders = ("edge-agent", "relay", "spa/src", "spa/e2e", "wire", "tests", "tools", "loadtests")
    known = {file.name for folder in folders for file in (ROOT / folder).rglob("*.*")}
    assert [name for name in named if name not in known] == []


def test_it_names_a_file_for_each_step() -> None:
    steps = re.findall(r"^\| (\d+) \| (?:edge|relay|page) `", OVERVIEW.read_text(), re.MULTILINE)
    assert [int(step) for step in steps] == list(range(1, 15))


def test_the_pages_name_many_files() -> None:
    assert len(find_names(OVERVIEW)) > 40
    assert len({name for page in NAMING for name in find_names(page)}) > 200


FAULT_TESTS = (ROOT / "docs/reference/fault-tests.md").read_text(encoding="utf-8")
FAULTS = ROOT / "tests/faults"


def rows(heading: str) -> list[list[str]]:
    """The cells of the table below a heading that begins so, without its head."""
    (section,) = re.findall(rf"^## {heading}[^\n]*$(.*?)(?=^## |\Z)", FAULT_TESTS, re.DOTALL | re.MULTILINE)
    lines = [line for line in section.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines[1:]]


def test_each_browser_test_exists() -> None:
    named = {name for *_, tests in rows("Browser tests") for name in re.findall(r"`(\w+)`", tests)}
    assert len(named) > 10
    for name in named:
        assert (ROOT / f"spa/e2e/{name}.test.ts").is_file(), name
    for name in re.findall(r"unit test `(\w+)`", FAULT_TESTS):
        assert len([*(ROOT / "spa/tests").glob(f"**/{name}.test.ts")]) == 1, name


def test_each_way_to_break_a_part_is_listed() -> None:
    listed = [(part, re.findall(r"^`(\w+)`", promise)[0]) for part, promise, *_ in rows("Broken parts")]
    written = [
        (part, way)
        for part, file in (("relay", "broken_relay.py"), ("agent", "broken_edge.py"))
        for way in re.findall(r'"(\w+)": \w+[,}]', (FAULTS / file).read_text(encoding="utf-8"))
    ]
    assert listed == written


def test_each_file_that_is_named_exists() -> None:
    named = re.findall(r"tests/faults/\w+\.\w+", FAULT_TESTS)
    assert named
    for path in named:
        assert (ROOT / path).is_file(), path
