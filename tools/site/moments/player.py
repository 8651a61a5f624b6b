"""Puts the player into the gallery: one copy of the built page, and two small pages for each moment."""

from __future__ import annotations

import html
import re
from pathlib import Path

from posecast_relay.recording.page import ENTRIES, GENERAL, TITLE, copy_page_files

ADDRESS = re.compile(r'((?:href|src)=")(?:\./)?')  # of what lies beside the page


def add_player(page: Path, folder: Path) -> None:
    """Copy the files of the built page into a folder, without its own entries."""
    copy_page_files(page, folder)


def add_entries(page: Path, folder: Path, name: str, title: str) -> None:
    """Write `NAME/index.html` and `NAME/embed/index.html`, which play `NAME.json` of the same folder with the
    player there."""
    for entry, home in ENTRIES.items():
        text = GENERAL.sub("", (page / entry).read_text(encoding="utf-8"))
        text = ADDRESS.sub(r"\1../", text)
        meta = f'<meta name="posecast-recording" content="{home}../{name}.json" />'
        text = text.replace(TITLE, f"{meta}\n    <title>{html.escape(title)} · Posecast</title>", 1)
        place = folder / name / entry
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text, encoding="utf-8")
