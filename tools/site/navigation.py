"""The guide's navigation: each page is listed in its folder, after the pages to read first."""

from __future__ import annotations

import re
from pathlib import Path

Item = str | dict[str, "str | list[Item]"]

TABS = {
    "tutorials": "Tutorials",
    "how-to": "How-to guides",
    "reference": "Reference",
    "explanation": "Explanation",
    "project": "Project",
}
TITLES = {"mujoco": "MuJoCo", "api": "API"}
# the first pages of each folder, in this order; the others follow by title
FIRST = {
    "tutorials": ("first-robot", "find-the-fault", "balance-lesson"),
    "how-to": ("install", "robots", "watch", "record", "operate", "scale"),
    "how-to/install": ("install",),
    "how-to/robots": ("add-a-robot", "urdf", "python", "ros2"),
    "how-to/watch": ("watch-a-robot", "numbers-and-faults", "look-back", "share-and-embed"),
    "how-to/record": ("keep-a-lecture", "save-from-the-page", "host-a-recording"),
    "reference": (
        "glossary",
        "profile",
        "signs",
        "settings",
        "robots-file",
        "protocol",
        "routes",
        "python-api",
    ),
    "explanation": ("states", "faults", "balance", "edge-agent", "relay", "web-page", "rendering", "lane"),
}


def make_navigation(pages: Path) -> list[Item]:
    """The tabs and their pages, for all pages below a folder."""
    tabs: list[Item] = [{"Home": "index.md"}] if (pages / "index.md").is_file() else []
    for name, title in TABS.items():
        items = _list_folder(pages, Path(name)) if (pages / name).is_dir() else []
        if name == "explanation":
            items = [*_list_overviews(pages), *items]
        if items:
            tabs.append({title: items})
    if (pages / "gallery.md").is_file():
        tabs.append({"Gallery": "gallery.md"})
    return tabs


def _list_overviews(pages: Path) -> list[Item]:
    return [page.name for page in sorted(pages.glob("[A-Z]*.md"))]


def _list_folder(pages: Path, folder: Path) -> list[Item]:
    first = FIRST.get(folder.as_posix(), ())

    def order(path: Path) -> tuple[bool, int, str]:
        rank = first.index(path.stem) if path.stem in first else len(first)
        return path.stem != "index", rank, _read_title(path)

    items: list[Item] = []
    for path in sorted((pages / folder).iterdir(), key=order):
        if path.is_dir() and (below := _list_folder(pages, folder / path.name)):
            items.append({_read_title(path): below})
        elif path.suffix == ".md":
            items.append((folder / path.name).as_posix())
    return items


def _read_title(path: Path) -> str:
    """A page's heading, or a folder's title."""
    if path.is_dir():
        return TITLES.get(path.name) or path.name.replace("-", " ").capitalize()
    found = re.search(r"^# (.+)$", path.read_text(encoding="utf-8"), re.MULTILINE) if path.is_file() else None
    return found[1] if found else path.stem
