"""Words, sentences and Flesch's reading ease of a page, counting its prose but not its code and tables."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from statistics import median

import pyphen
from markdown_it import MarkdownIt
from markdown_it.token import Token

MARKDOWN = MarkdownIt("commonmark").enable("table")
SENTENCE_END = re.compile(r"(?<=[.!?])[\"')\]]*\s+(?=[\"'(\[]*[A-Z0-9`])")
ABBREVIATION = re.compile(r"\b(?:e\.g|i\.e|etc|vs|cf|approx|No|St)\.$")
WORD = re.compile(r"[^\W_][\w'’.:/-]*")
CODE = "code"  # stands for a piece of code in a sentence: counts as one easy word


@dataclass(frozen=True)
class ProseFigures:
    """`words`: of the page, with tables and headings, without code blocks; `sentence_words`: of each sentence
    of its prose; `flesch`: 0 is hard, 100 easy; 60 is plain English."""

    words: int
    sentence_words: tuple[int, ...]
    flesch: float

    @property
    def median(self) -> float:
        """Median sentence length in words; 0 on a page without sentences."""
        return median(self.sentence_words) if self.sentence_words else 0


def measure_prose(page: str) -> ProseFigures:
    """The figures of a page of Markdown."""
    tokens = MARKDOWN.parse(page)
    words = sum(len(find_words(_read_text(token))) for token in tokens if token.type == "inline")
    sentences = [found for text in _list_paragraphs(tokens) for found in split_sentences(text)]
    lengths = [len(find_words(sentence)) for sentence in sentences]
    syllables = sum(count_syllables(word) for sentence in sentences for word in find_words(sentence))
    total = sum(lengths)
    flesch = 206.835 - 1.015 * total / len(lengths) - 84.6 * syllables / total if total else 100.0
    return ProseFigures(words, tuple(lengths), flesch)


def split_sentences(text: str) -> list[str]:
    """The sentences of a paragraph that contain a word."""
    found: list[str] = []
    for part in SENTENCE_END.split(text):
        if found and ABBREVIATION.search(found[-1]):
            found[-1] += f" {part}"
        else:
            found.append(part)
    return [sentence for sentence in found if find_words(sentence)]


def find_words(text: str) -> list[str]:
    """The words of a text, including numbers."""
    return WORD.findall(text)


@cache
def count_syllables(word: str) -> int:
    """Counted by possible hyphenation points; at least one."""
    return len(_hyphenation().positions(word.lower())) + 1


@cache
def _hyphenation() -> pyphen.Pyphen:
    return pyphen.Pyphen(lang="en_US", left=1, right=1)


def _list_paragraphs(tokens: list[Token]) -> Iterator[str]:
    """Paragraphs and items of lists."""
    for opening, inline in pairwise(tokens):
        if opening.type == "paragraph_open":
            yield _read_text(inline)


def _read_text(inline: Token) -> str:
    parts = {"softbreak": " ", "hardbreak": " ", "code_inline": CODE}
    return "".join(
        parts.get(token.type, token.content if token.type == "text" else "")
        for token in inline.children or []
    )
