"""Puts pictures of many robots on contact sheets.

python -m tools.gallery.sheets FOLDER: reads FOLDER/shown.json, a list of a name, a picture's path or null,
and the text shown instead of a missing picture.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from tools.gallery.picture import EYES, PAPER, SIDE

NAME = 18  # pixels below a picture
CHARACTERS = 52  # per line
ACROSS, DOWN = 6, 5
INK, RED, RULE = (40, 44, 52), (190, 30, 30), (210, 212, 216)


def write_sheets(robots: Sequence[tuple[str, str | None, str]], out: Path) -> list[Path]:
    """Put pictures on sheets, ACROSS × DOWN each. `robots`: name, picture or None, and the text shown instead
    of a missing picture. Returns the sheets' paths."""
    font = ImageFont.load_default(size=11)
    width, height = SIDE * len(EYES) + 6, SIDE + NAME
    sheets: list[Path] = []
    for start in range(0, len(robots), ACROSS * DOWN):
        shown = robots[start : start + ACROSS * DOWN]
        rows = -(-len(shown) // ACROSS)
        sheet = Image.new("RGB", (ACROSS * width, rows * height), PAPER)
        pen = ImageDraw.Draw(sheet)
        for number, (name, picture, said) in enumerate(shown):
            x, y = number % ACROSS * width, number // ACROSS * height
            if picture is not None:
                with Image.open(picture) as image:
                    sheet.paste(image, (x, y))
            else:
                for line in range(6):
                    pen.text((x + 6, y + 30 + 14 * line), said[line * CHARACTERS :][:CHARACTERS], RED, font)
            below = name if len(name) <= CHARACTERS else f"…{name[1 - CHARACTERS :]}"
            pen.text((x + 6, y + SIDE), below, INK if picture is not None else RED, font)
            pen.rectangle((x, y, x + width - 1, y + height - 1), outline=RULE)
        sheets.append(out / f"sheet-{len(sheets) + 1}.png")
        sheet.save(sheets[-1])
    return sheets


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    write_sheets(json.loads((folder / "shown.json").read_text()), folder)
