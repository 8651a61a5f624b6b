"""Readability of each page of the documentation: words, median and longest sentence, reading ease.

python -m tools.prose [PAGE…]
"""

from __future__ import annotations

import sys
from pathlib import Path
from statistics import median

from tools.prose.figures import measure_prose

ROOT = Path(__file__).resolve().parents[2]


def list_pages() -> list[Path]:
    """README, CONTRIBUTING and docs/."""
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]


def main() -> None:
    pages = [Path(name).resolve() for name in sys.argv[1:]] or list_pages()
    lengths: list[int] = []
    print(" words  median  longest  Flesch")
    for page in pages:
        found = measure_prose(page.read_text(encoding="utf-8"))
        lengths += found.sentence_words
        longest = max(found.sentence_words, default=0)
        name = page.relative_to(ROOT) if page.is_relative_to(ROOT) else page
        print(f"{found.words:6d}  {found.median:6g}  {longest:7d}  {found.flesch:6.0f}  {name}")
    print(f"median of all {len(lengths)} sentences: {median(lengths) if lengths else 0:g} words")


if __name__ == "__main__":
    main()
