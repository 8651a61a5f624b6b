"""`python -m wire.python.tools` makes the vectors in `wire/vectors/` anew, but what is kept for good."""

from __future__ import annotations

from pathlib import Path

from wire.python.tools import (
    make_balance_vectors,
    make_key_page_vectors,
    make_recording_vectors,
    make_schema_vectors,
    make_segment_vectors,
    make_vectors,
)

FOLDER = Path(__file__).resolve().parents[2] / "vectors"
MAKERS = (
    make_vectors,
    make_schema_vectors,
    make_segment_vectors,
    make_key_page_vectors,
    make_recording_vectors,
    make_balance_vectors,
)


def make_files() -> dict[str, str]:
    """Every file's name and text."""
    return {name: text for maker in MAKERS for name, text in maker.files().items()}


if __name__ == "__main__":
    for name, content in make_files().items():
        (FOLDER / name).write_text(content, encoding="utf-8")
        print(f"{name}: {len(content.encode())} bytes")
