"""Collects the files that a MuJoCo model names, only inside the folders that belong to it.

MuJoCo itself would open any file that a model names. So it gets the contents of these files and can't open
any itself (child.py). Where it looks for a file depends on compiler settings that includes and attached
models may change, so each file is looked up in every folder that may be meant.
"""

from __future__ import annotations

import html
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.text import read_text
from posecast_edge.model.urdf.resolver import MISSING, Resolver, read_bounded, resolve_links

XML_MAX = 32 << 20  # bytes of one file
NAMES_MAX = 4000  # files that are looked for
BASES_MAX = 16  # folders in which each is looked for
BYTES_MAX = 512 << 20  # of all files together
PARTS = (".xml", ".mjcf", ".urdf")
ASSETS = (".stl", ".obj", ".msh", ".png", ".ktx", ".skn", ".hf", ".bin")
# Not a parser: MuJoCo's accepts files that others refuse. A name that is not a file does no harm here.
NAMED = re.compile(
    r"""\b(file\w{0,9}|meshdir|texturedir|assetdir)\s*=\s*(?:"([^"<]{1,4096})"|'([^'<]{1,4096})')"""
)


@dataclass
class ModelFiles:
    """`main`: the model's path that MuJoCo is given; `contents`: of each file, by the path that MuJoCo asks
    for; `inputs`: the real paths of all that was read; `refused`: why a file that the model names was not
    read, by its name."""

    main: str
    contents: dict[str, bytes] = field(default_factory=dict)
    inputs: dict[Path, None] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)


def collect_files(path: Path, packages: Sequence[Path] = ()) -> ModelFiles:
    """Read the model and all that it names. `packages`: folders that belong to it too.

    Raises ModelRefused when the model itself can't be read or names too much.
    """
    return _Collector(path, packages).collect()


def list_names(xml: bytes) -> Iterator[tuple[str, str]]:
    """The attributes of an MJCF file that name files or folders: (attribute, name)."""
    for match in NAMED.finditer(xml.decode("utf-8", "replace")):
        name = html.unescape(match[2] or match[3]).replace("\\", "/")
        if name and "\0" not in name:
            yield match[1], name


class _Collector:
    def __init__(self, path: Path, packages: Sequence[Path]) -> None:
        self._path = path
        main = resolve_links(path)
        self._folder = main.parent
        self._resolver = Resolver(path, packages)
        self._files = ModelFiles(str(main))
        self._left = BYTES_MAX
        self._bases: dict[str, None] = {}
        self._names: dict[str, None] = {}

    def collect(self) -> ModelFiles:
        data = self._read(self._path, XML_MAX)
        self._files.contents[self._files.main] = data
        waiting = self._look_at(data, self._folder)
        while waiting:
            found = list(self._find(waiting.pop(), PARTS))
            for folder, content in found:
                waiting += self._look_at(content, folder)
        for name in self._names:
            if not _is_part(name):
                for _ in self._find(name, ASSETS):
                    pass
        return self._files

    def _look_at(self, xml: bytes, folder: Path) -> list[str]:
        """Note the files that it names, and the folders it names for them. Returns other XML among them."""
        self._add_base(folder)
        parts = []
        for attribute, name in list_names(xml):
            if not attribute.startswith("file"):
                self._add_base(folder / name)
                self._add_base(self._folder / name)
            elif name not in self._names:
                if len(self._names) >= NAMES_MAX:
                    raise ModelRefused(f"names more than {NAMES_MAX} files")
                self._names[name] = None
                parts += [name] if _is_part(name) else []
        return parts

    def _add_base(self, folder: Path) -> None:
        if len(self._bases) < BASES_MAX:
            self._bases[os.path.normpath(folder)] = None

    def _find(self, name: str, suffixes: Sequence[str]) -> Iterator[tuple[Path, bytes]]:
        """Wherever it may be meant: its folder and its content."""
        reason, found = MISSING, False
        for wanted in dict.fromkeys((name, PurePosixPath(name).name)):
            for base in list(self._bases):
                path = os.path.normpath(os.path.join(base, wanted))
                if path in self._files.contents:
                    found = True
                    continue
                try:
                    real = self._resolver.find_at(Path(path), suffixes)
                    content = self._read(real, XML_MAX if suffixes is PARTS else BYTES_MAX)
                except ModelRefused as e:
                    reason = e.reason if reason == MISSING else reason
                    continue
                found = True
                self._files.contents[path] = content
                yield Path(path).parent, content
            if found:
                return
        self._files.refused[name] = reason

    def _read(self, path: Path, most: int) -> bytes:
        content = read_bounded(path, min(most, self._left))
        self._left -= len(content)
        self._files.inputs[resolve_links(path)] = None
        return read_text(content).utf8 if most == XML_MAX else content


def _is_part(name: str) -> bool:
    return name.lower().endswith(PARTS)
