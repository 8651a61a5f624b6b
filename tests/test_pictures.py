"""The pictures in the docs: each exists, is small, has a text, is made by a command, and is used."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from PIL import Image, ImageDraw, ImageSequence

from tools.moving_picture import join_frames, main

pytestmark = pytest.mark.docs

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "docs/img"
MOVING = FOLDER / "jam.webp"
BYTES_MAX = {MOVING.name: 1_500_000}
BYTES_MAX_ELSE = 150_000
ALL_BYTES_MAX = 2_500_000
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
DRAWN = ".svg"  # plots, which other tools make of tables

MARKDOWN = re.compile(r"!\[([^\]]*)\]\(([^)\s]+)\)")
HTML = re.compile(r"<(?:img|source)\b[^>]*>")
ADDRESS = re.compile(r'\bsrc(?:set)?="([^"]+)"')
WORDS = re.compile(r'\balt="([^"]*)"')


def pictures_of(page: Path) -> list[tuple[Path, str | None]]:
    """(file, alternative text; None if an element beside it has the text) in a page."""
    text = page.read_text()
    found: list[tuple[Path, str | None]] = [(page.parent / to, words) for words, to in MARKDOWN.findall(text)]
    for element in HTML.findall(text):
        address, words = ADDRESS.search(element), WORDS.search(element)
        assert address, element
        if element.startswith("<img"):
            assert words, f"{page.name}: {element} has no words"
        found.append((page.parent / address[1], words[1] if words else None))
    return [(file.resolve(), words) for file, words in found if "://" not in str(file)]


NAMED = [(page, *found) for page in PAGES for found in pictures_of(page)]


def test_each_picture_that_the_docs_name_is_there_and_told_in_words() -> None:
    assert len(NAMED) > 15
    for page, file, words in NAMED:
        assert file.is_file(), f"{page.name} names {file.name}"
        assert words is None or len(words.split()) >= 3, f"{page.name}: {file.name} is not described"


def test_each_picture_is_named_and_small() -> None:
    files = sorted(FOLDER.iterdir())
    assert {f.name for f in files} == {file.name for _, file, _ in NAMED if file.parent == FOLDER}
    for file in files:
        assert file.stat().st_size <= BYTES_MAX.get(file.name, BYTES_MAX_ELSE), file.name
    assert sum(file.stat().st_size for file in files) <= ALL_BYTES_MAX


def test_each_screenshot_is_made_by_make_pictures() -> None:
    """Each WebP is written by a file in spa/e2e/pictures, and each file written there exists."""
    source = "".join(path.read_text() for path in sorted((ROOT / "spa/e2e/pictures").glob("*.ts")))
    made = set(re.findall(r"\b(?:write\(\s*page,|draw\()\s*'([a-z-]+)'", source))
    made |= set(re.findall(r"docs/img/([a-z-]+)\.webp", source))
    assert {f.stem for f in FOLDER.iterdir() if f.suffix != DRAWN} == made


def times_ms(moving: Path) -> list[int]:
    """How long each frame is shown; identical frames are merged and shown for longer."""
    with Image.open(moving) as picture:
        assert picture.info["loop"] == 0  # for ever
        times = []
        for frame in ImageSequence.Iterator(picture):
            frame.load()  # which tells its time
            times.append(int(frame.info["duration"]))
        return times


def test_the_moving_picture_lasts_six_seconds() -> None:
    with Image.open(MOVING) as picture:
        assert picture.size == (960, 540)
    assert len(times_ms(MOVING)) >= 50
    assert sum(times_ms(MOVING)) == 6000


def frames(folder: Path, *widths: int) -> None:
    for i, width in enumerate(widths):
        image = Image.new("RGB", (width, 20), "white")
        ImageDraw.Draw(image).rectangle((i, 0, i + 5, 5), fill="red")
        image.save(folder / f"{i:03}.png")


def test_frames_are_joined_in_order(tmp_path: Path) -> None:
    frames(tmp_path, 30, 30, 30)
    out = tmp_path / "out.webp"
    assert join_frames(tmp_path, out, 100) == out.stat().st_size
    assert times_ms(out) == [100, 100, 100]
    with Image.open(out) as picture:
        assert picture.size == (30, 20)


@pytest.mark.parametrize(
    ("widths", "said"), [((), "0 PNG files"), ((30, 31), "001.png: (31, 20) pixels, the first has (30, 20)")]
)
def test_frames_that_do_not_fit_are_named(
    widths: tuple[int, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    frames(tmp_path, *widths)
    assert main([str(tmp_path), str(tmp_path / "out.webp")]) == 2
    assert said in capsys.readouterr().err
