"""The fenced blocks of all pages."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from markdown_it import MarkdownIt

ROOT = Path(__file__).resolve().parents[2]
LISTED = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"]


@dataclass(frozen=True)
class Block:
    """A fenced block. `page`: relative to the repository; `line`: of its fence, from 1."""

    page: str
    line: int
    language: str
    text: str

    @property
    def source(self) -> str:
        """The block with the line of its fence, without the indent of a list."""
        return f"```{self.language}\n{self.text}```"

    def __str__(self) -> str:
        first = self.text.strip().partition("\n")[0]
        return f"{self.page}:{self.line} [{self.language}] {first[:60]}"


def list_blocks(page: str, text: str) -> list[Block]:
    """The fenced blocks of a page, in order."""
    return [
        Block(page, (token.map or [0])[0] + 1, token.info.strip(), token.content)
        for token in MarkdownIt("commonmark").parse(text)
        if token.type == "fence"
    ]


def read_blocks(page: str, language: str, words: str = "") -> list[str]:
    """The texts of a page's blocks of a language that have these words. `page`: as in `read_pages`."""
    return [b.text for b in read_pages().get(page, ()) if b.language == language and words in b.text]


@cache
def read_pages() -> dict[str, list[Block]]:
    """The blocks of every page in the repository that has some."""
    listed = subprocess.run(LISTED, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    pages = {name: ROOT / name for name in sorted(listed) if (ROOT / name).exists()}
    found = {name: list_blocks(name, path.read_text(encoding="utf-8")) for name, path in pages.items()}
    return {name: blocks for name, blocks in found.items() if blocks}
