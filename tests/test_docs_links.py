"""Every relative link, anchor and picture on every page exists."""

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
