"""Copies the built page into a recording's folder, and marks it with what to play and what chats show."""

from __future__ import annotations

import html
import json
import re
import shutil
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType

from posecast_wire.checked import loads
from posecast_wire.recording import RECORDING_FILE, PastRecording, model_path

from posecast_relay.logging import visible
from posecast_relay.models.manifest import ManifestError, read_manifest, read_thumbnail
from posecast_relay.models.picture import PictureError, PictureSize, read_picture_size
from posecast_relay.recording.output import PAGE_FILES, PAGE_FOLDERS, OutputError

ENTRIES: Mapping[str, str] = {"index.html": "", "embed/index.html": "../"}
PARTS = ".vite/manifest.json"  # the build's own list of its files, and of what each of them imports
FIRST_PART = "src/app/pages/recording/RecordingPage.tsx"
PACKED = frozenset((".br", ".gz"))  # beside the files that they were made of; hosts compress by themselves
GENERAL = re.compile(r'\s*<meta (?:property="og:|name="description")[^>]*>')
SHOWN_MAX = 500  # characters of a text that a chat reads
RECORDING_TAG = '<meta name="posecast-recording"'
TITLE = "<title>Posecast</title>"
UNPACKS = re.compile(
    rb"new DecompressionStream\([\"'`]gzip[\"'`]\)"
)  # of wire/typescript/src/recording/packed.ts


def check_page(page: Path) -> None:
    """Raise OutputError when a folder does not hold the built page."""
    for name in ENTRIES:
        try:
            is_page = TITLE in (page / name).read_text(encoding="utf-8")
        except (OSError, ValueError):
            is_page = False
        if not is_page:
            raise OutputError(f"--page {page}: not a built page: {name} is not Posecast's")


def unpacks_segments(page: Path) -> bool:
    """Whether this build of the page reads segments packed as gzip; older builds do not."""
    return any(UNPACKS.search(file.read_bytes()) for file in sorted((page / "assets").glob("*.js")))


def add_page(
    page: Path,
    folder: Path,
    recording: PastRecording,
    address: str | None,
    data: Mapping[str, int] = MappingProxyType({}),
) -> None:
    """Copy the page into a recording's folder: what a build of ours has, but not what FastAPI shows, what a
    relay alone serves, or the build's own notes. So whatever else lies in such a folder is somebody's own.

    `address`: where it is to lie, as chats want it whole for the picture; `data`: files beside the page that
    it offers, and their sizes in bytes. Raises OSError.
    """
    copy_page_files(page, folder)
    parts = _list_first_parts(page)
    for name, home in ENTRIES.items():
        text = (page / name).read_text(encoding="utf-8")
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        marked = _mark(text, home, folder, recording, address)
        if name == "index.html":  # a frame asks for nothing before it is seen
            if data:
                offered = " ".join(f"{file} {size}" for file, size in data.items())
                tag = f'<meta name="posecast-data" content="{offered}" />'
                marked = marked.replace(RECORDING_TAG, f"{tag}\n    {RECORDING_TAG}", 1)
            links = [f'  <link rel="modulepreload" crossorigin href="./{part}">\n  ' for part in parts]
            marked = marked.replace("</head>", f"{''.join(links)}</head>", 1)
        (folder / name).write_text(marked, encoding="utf-8")


def copy_page_files(page: Path, folder: Path) -> None:
    """Copy what a built page needs into a folder, without the two pages themselves. Raises OSError."""
    for path in sorted(page.rglob("*")):
        relative = path.relative_to(page)
        if relative.parts[0] not in PAGE_FILES | PAGE_FOLDERS or path.suffix in PACKED or not path.is_file():
            continue
        if any(part.startswith(".") for part in relative.parts) or relative.as_posix() in ENTRIES:
            continue
        (folder / relative).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, folder / relative)


def _list_first_parts(page: Path) -> list[str]:
    """The scripts that a recording's first pose waits for, besides the page's own: a browser told of them
    fetches them side by side with that one. None where the build has left no list."""
    try:
        chunks = json.loads((page / PARTS).read_text(encoding="utf-8"))
        found: dict[str, None] = {}
        seen = {"index.html", *chunks["index.html"].get("imports", ())}
        waiting = [FIRST_PART] if FIRST_PART in chunks else []
        for name in waiting:
            if name not in seen:
                seen.add(name)
                found[str(chunks[name]["file"])] = None
                waiting.extend(chunks[name].get("imports", ()))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return []
    return [file for file in found if re.fullmatch(r"assets/[\w.-]+\.js", file) and (page / file).is_file()]


def _mark(page: str, home: str, folder: Path, recording: PastRecording, address: str | None) -> str:
    title = visible(recording.title or _name_robot(recording), SHOWN_MAX)
    base = home or "./" if address is None else f"{address.rstrip('/')}/"
    tags = [f'{RECORDING_TAG} content="{home}{RECORDING_FILE}" />']
    tags += [
        f'<meta {kind}="{name}" content="{html.escape(text)}" />'
        for kind, name, text in _describe(title, base, folder, recording, address)
    ]
    tags.append(f"<title>{html.escape(title)} · Posecast</title>")
    page = GENERAL.sub("", page)
    return page.replace(TITLE, "\n    ".join(tags), 1)


def _describe(
    title: str, base: str, folder: Path, recording: PastRecording, address: str | None
) -> list[tuple[str, str, str]]:
    """Kind, name and text of each tag that a chat reads."""
    told = visible(_tell(recording), SHOWN_MAX)
    tags = [
        ("name", "description", told),
        ("property", "og:site_name", "Posecast"),
        ("property", "og:type", "website"),
        ("property", "og:title", title),
        ("property", "og:description", told),
        ("name", "twitter:card", "summary"),
    ]
    picture = _find_picture(folder, recording)
    tags.append(("property", "og:image", f"{base}{'icon-512.png' if picture is None else picture[0]}"))
    if picture is not None:
        tags.append(("property", "og:image:width", str(picture[1].width_px)))
        tags.append(("property", "og:image:height", str(picture[1].height_px)))
        tags.append(("property", "og:image:alt", title))
    if address is not None:
        tags.append(("property", "og:url", base))
    return tags


def _tell(recording: PastRecording) -> str:
    """When it was and how long it is, who made it and what one may do with it: in one line."""
    at = datetime.fromtimestamp(recording.from_ms // 1000, UTC)
    minutes, seconds = divmod((recording.to_ms - recording.from_ms + 500) // 1000, 60)
    told = f"A robot recorded on {at:%-d %B %Y}, {minutes}:{seconds:02d} minutes."
    return " ".join([told, *(f"{text}." for text in (recording.author, recording.licence) if text)])


def _name_robot(recording: PastRecording) -> str:
    """The robot's name for people, as its schema has it; else its id."""
    for text in recording.schemas.values():
        try:
            doc = loads(text)
        except ValueError:
            continue
        name = doc.get("robot") if isinstance(doc, dict) else None
        if isinstance(name, str) and name:
            return name
    return recording.robot


def _find_picture(folder: Path, recording: PastRecording) -> tuple[str, PictureSize] | None:
    """Path and size of the small picture in one of the models."""
    for model in recording.models:
        try:
            manifest = (folder / model_path(model, "manifest.json")).read_bytes()
            name = read_thumbnail(manifest)
            entry = read_manifest(manifest).get(name)
            if entry is None:
                continue
            data = (folder / model_path(model, name)).read_bytes()
            return model_path(model, name), read_picture_size(data, entry.type)
        except (OSError, ManifestError, PictureError):
            continue
    return None
