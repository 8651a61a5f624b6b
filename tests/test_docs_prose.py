"""The documentation is short and plain: limits for the length of pages and sentences, and words to avoid.

`make check` runs the vocabulary (tools/prose/vocabulary.yml) over each page that is not unfinished yet.
"""

from __future__ import annotations

import json
import subprocess
from functools import cache
from pathlib import Path
from statistics import median

import pytest

from tools.prose.__main__ import list_pages
from tools.prose.figures import count_syllables, measure_prose, split_sentences

pytestmark = pytest.mark.docs

ROOT = Path(__file__).resolve().parent.parent
SENTENCE_WORDS = 16
PAGE_WORDS = 1500  # reference pages may be longer: nobody reads them from top to bottom
UNFINISHED = ROOT / "tools/prose/unfinished.txt"
PAGES = {str(path.relative_to(ROOT)): path for path in list_pages()}


def read_unfinished() -> set[str]:
    lines = UNFINISHED.read_text(encoding="utf-8").splitlines() if UNFINISHED.exists() else []
    return {line for line in lines if line and not line.startswith("#")}


FINISHED = sorted(PAGES.keys() - read_unfinished())


@cache
def find_words_to_replace() -> dict[str, list[str]]:
    """Page → what the vocabulary reports, also for unfinished pages."""
    command = ["npx", "--no-install", "textlint", "--ignore-path", "/dev/null", "--format", "json", *PAGES]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr
    return {
        str(Path(page["filePath"]).relative_to(ROOT)): [message["message"] for message in page["messages"]]
        for page in json.loads(done.stdout)
    }


def may_be_long(page: str) -> bool:
    return page.startswith("docs/reference/")


def list_faults(page: str) -> list[str]:
    found = measure_prose(PAGES[page].read_text(encoding="utf-8"))
    faults = list(find_words_to_replace().get(page, ()))
    if found.words > PAGE_WORDS and not may_be_long(page):
        faults.append(f"{found.words} words, {PAGE_WORDS} are allowed: split it by task")
    if found.median > SENTENCE_WORDS:
        faults.append(f"a median sentence of {found.median:g} words")
    return faults


def test_the_median_sentence_is_short() -> None:
    figures = {page: measure_prose(PAGES[page].read_text(encoding="utf-8")) for page in FINISHED}
    for page, found in figures.items():
        print(f"{found.flesch:5.0f} reading ease  {found.median:5g} words in the median sentence  {page}")
    assert median(length for found in figures.values() for length in found.sentence_words) <= SENTENCE_WORDS


@pytest.mark.parametrize("page", [page for page in FINISHED if not may_be_long(page)])
def test_a_page_is_read_in_a_few_minutes(page: str) -> None:
    words = measure_prose(PAGES[page].read_text(encoding="utf-8")).words
    assert words <= PAGE_WORDS, f"{page}: split it by task"


@pytest.mark.parametrize("page", sorted(read_unfinished()))
def test_a_page_on_the_list_of_unfinished_ones_has_something_left(page: str) -> None:
    assert page in PAGES, f"{page} does not exist: take it off {UNFINISHED.relative_to(ROOT)}"
    assert list_faults(page), f"{page} is finished: take it off {UNFINISHED.relative_to(ROOT)}"


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
    found = measure_prose(
        "# One heading\n\nTwo words. This has `some code` in it.\n\n- An item here.\n\n"
        "```sh\nnot counted at all\n```\n\n| a | table |\n|---|---|\n| one | two |\n"
    )
    assert found.sentence_words == (2, 5, 3)
    assert found.median == 3
    assert found.words == 2 + 2 + 5 + 3 + 4


def test_sentences_and_syllables() -> None:
    assert split_sentences("It takes 0.5 s. See e.g. the log. Why?") == [
        "It takes 0.5 s.",
        "See e.g. the log.",
        "Why?",
    ]
    assert [count_syllables(word) for word in ("robot", "relay", "the", "publisher")] == [2, 2, 1, 3]
    easy, hard = (
        "The cat sat. It ran.",
        "Configuration authorisation necessitates organisational documentation.",
    )
    assert measure_prose(easy).flesch > 100 > 50 > measure_prose(hard).flesch
