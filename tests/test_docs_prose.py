"""The documentation is short and plain: limits for the length of pages and sentences. `make check` runs the
vocabulary (tools/vocabulary.yml) over each page."""

from __future__ import annotations

import json
import re
import subprocess
from itertools import pairwise
from pathlib import Path
from statistics import median

import pytest
from markdown_it import MarkdownIt
from markdown_it.token import Token

pytestmark = pytest.mark.docs

ROOT = Path(__file__).resolve().parent.parent
SENTENCE_WORDS = 16
PAGE_WORDS = 1500  # reference pages may be longer: nobody reads them from top to bottom
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
MARKDOWN = MarkdownIt("commonmark").enable("table")
SENTENCE_END = re.compile(r"(?<=[.!?])[\"')\]]*\s+(?=[\"'(\[]*[A-Z0-9`])")
ABBREVIATION = re.compile(r"\b(?:e\.g|i\.e|etc|vs|cf|approx|No|St)\.$")
WORD = re.compile(r"[^\W_][\w'’.:/-]*")
SPOKEN = {"softbreak": " ", "hardbreak": " ", "code_inline": "code"}  # a piece of code is one word


def measure_prose(page: str) -> tuple[int, list[int]]:
    """The words of a page, with tables and headings, without code blocks; and those of each sentence of its
    paragraphs and lists."""
    tokens = MARKDOWN.parse(page)
    words = sum(len(WORD.findall(read_text(token))) for token in tokens if token.type == "inline")
    texts = [read_text(inline) for opening, inline in pairwise(tokens) if opening.type == "paragraph_open"]
    return words, [len(WORD.findall(sentence)) for text in texts for sentence in split_sentences(text)]


def split_sentences(text: str) -> list[str]:
    """The sentences of a paragraph that contain a word."""
    found: list[str] = []
    for part in SENTENCE_END.split(text):
        if found and ABBREVIATION.search(found[-1]):
            found[-1] += f" {part}"
        else:
            found.append(part)
    return [sentence for sentence in found if WORD.search(sentence)]


def read_text(inline: Token) -> str:
    return "".join(
        SPOKEN.get(token.type, token.content if token.type == "text" else "")
        for token in inline.children or []
    )


def test_the_median_sentence_is_short() -> None:
    lengths = [length for page in PAGES for length in measure_prose(page.read_text(encoding="utf-8"))[1]]
    assert median(lengths) <= SENTENCE_WORDS


def test_a_page_is_read_in_a_few_minutes() -> None:
    counts = {page: measure_prose(page.read_text(encoding="utf-8"))[0] for page in PAGES}
    long = {page.name: words for page, words in counts.items() if words > PAGE_WORDS}
    assert long.keys() <= {page.name for page in PAGES if "reference" in page.parts}, "split it by task"


def test_the_vocabulary_finds_what_it_is_for(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# A\n\nIt is said in a file, whom the relay lets in. `websocket` is code.\n\nUse a websocket.\n"
    )
    command = ["npx", "--no-install", "textlint", "--format", "json", str(page)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    (found,) = json.loads(done.stdout)
    assert [message["message"] for message in found["messages"]] == [
        "whom => who",
        "websocket => WebSocket",
    ]


def test_prose_is_measured_without_code_and_tables() -> None:
    page = (
        "# One heading\n\nTwo words. This has `some code` in it.\n\n- An item here.\n\n"
        "```sh\nnot counted at all\n```\n\n| a | table |\n|---|---|\n| one | two |\n"
    )
    assert measure_prose(page) == (2 + 2 + 5 + 3 + 4, [2, 5, 3])
    assert split_sentences("It takes 0.5 s. See e.g. the log. Why?") == [
        "It takes 0.5 s.",
        "See e.g. the log.",
        "Why?",
    ]
