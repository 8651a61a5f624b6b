"""Reads an SDF and the files that it includes."""

from __future__ import annotations

import io
import posixpath
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from posecast_edge.model.finding import ModelRefused, quote_name
from posecast_edge.model.sdf.shapes import join_uri
from posecast_edge.model.sdf.urdf_model import make_sdf
from posecast_edge.model.sdf.values import SdfValues, get_text, get_version
from posecast_edge.model.urdf.reader import BYTES_MAX, DEPTH_MAX, ELEMENTS_MAX, read_urdf
from posecast_edge.model.urdf.resolver import Resolver, open_file
from posecast_edge.model.urdf.xml_tree import Element, read_xml

INCLUDES_MAX = 200
NESTED_MAX = 8  # includes within includes


@dataclass(frozen=True)
class ModelElement:
    """A `<model>`, where it was found. `base`: what stands before its relative addresses; `include`: the
    element by which it came, which may give it another name and pose; `version`: of its file; `files`: those
    that include each other on the way to it."""

    element: Element
    base: str
    version: tuple[int, ...]
    files: tuple[Path, ...]
    include: Element | None = None

    @property
    def name(self) -> str | None:
        """The model's name, as its include says it."""
        return get_text(self.include, "name") or self.element.get("name")

    @property
    def pose(self) -> Element | None:
        """Where it is."""
        own = self.element.find_first("pose")
        return (self.include.find_first("pose") if self.include is not None else None) or own

    @property
    def placement(self) -> str:
        """The frame whose pose `pose` is; "" for the model's own."""
        given = get_text(self.include, "placement_frame")
        return given or self.element.get("placement_frame") or ""


class IncludeReader:
    """Reads files, all of them together within the bounds of one."""

    def __init__(self, resolver: Resolver | None, values: SdfValues) -> None:
        """`resolver`: None where no other file is to be read."""
        self._resolver, self._values = resolver, values
        self._bytes, self._elements, self._left = BYTES_MAX, ELEMENTS_MAX, INCLUDES_MAX
        self.inputs: list[Path] = []

    def read_main(self, content: bytes, path: Path) -> list[ModelElement]:
        """The models of the file that was asked for. Raises ModelRefused when it is no SDF."""
        return list(self._list_models(self._parse(content), "", (path,)))

    def list_nested(self, model: ModelElement) -> Iterator[ModelElement]:
        """The models inside of a model, in the file's order."""
        for child in model.element.children:
            if child.tag == "model":
                yield ModelElement(child, model.base, model.version, model.files)
            elif child.tag == "include":
                yield from self._include(child, model.base, model.files)

    def _list_models(self, root: Element, base: str, files: tuple[Path, ...]) -> Iterator[ModelElement]:
        """At the top of a file, and in its worlds."""
        version = get_version(root)
        for holder in (root, *root.find_all("world")):
            for child in holder.children:
                if child.tag == "model":
                    yield ModelElement(child, base, version, files)
                elif child.tag == "include":
                    yield from self._include(child, base, files)

    def _include(self, element: Element, base: str, files: tuple[Path, ...]) -> Iterator[ModelElement]:
        """The model that an `<include>` names; none where it can't be read, which is reported."""
        uri = get_text(element, "uri")
        try:
            found, path = self._read(uri, base, files)
        except ModelRefused as e:
            at = f"line {e.line} of it: " if e.line is not None else ""
            self._values.note("warning", "include", f"include {quote_name(uri)}: {at}{e.reason}", element)
            return
        inside = next(self._list_models(found, self._base_of(base, uri, path), (*files, path)), None)
        if inside is None:
            text = f"include {quote_name(uri)}: it has no model"
            self._values.note("warning", "include", text, element)
            return
        _set_lines(inside.element, element.line)
        yield ModelElement(inside.element, inside.base, inside.version, inside.files, element)

    def _read(self, uri: str, base: str, files: tuple[Path, ...]) -> tuple[Element, Path]:
        if not uri:
            raise ModelRefused("it names no file")
        if self._resolver is None:
            raise ModelRefused("includes are not read here")
        if len(files) > NESTED_MAX:
            raise ModelRefused(f"more than {NESTED_MAX} includes within each other")
        self._left -= 1
        if self._left < 0:
            raise ModelRefused(f"more than {INCLUDES_MAX} includes")
        path = self._resolver.find_description(join_uri(base, uri))
        if path in files:
            names = " → ".join(quote_name(p.name) for p in (*files[files.index(path) :], path))
            raise ModelRefused(f"files include each other: {names}")
        try:
            with open_file(path) as source:
                content = source.read(self._bytes + 1)
        except OSError as e:
            raise ModelRefused(e.strerror or str(e)) from None
        self.inputs.append(path)
        root = self._parse(content)
        if root.tag == "robot":
            urdf = read_urdf(io.BytesIO(content))
            if not urdf.links:
                raise ModelRefused("it has no links")
            root = make_sdf(urdf)
        return root, path

    def _parse(self, content: bytes) -> Element:
        if len(content) > self._bytes:
            raise ModelRefused(f"larger than {BYTES_MAX >> 20} MiB, including its includes")
        root = read_xml(
            io.BytesIO(content),
            bytes_max=self._bytes,
            elements_max=self._elements,
            depth_max=DEPTH_MAX,
            texts=True,
        )
        self._bytes -= len(content)
        self._elements -= _count(root)
        return root

    def _base_of(self, base: str, uri: str, path: Path) -> str:
        """The folder of an included file, spelt as its include does."""
        address = join_uri(base, uri)
        head, mark, rest = address.partition("://")
        if mark and head in ("model", "package"):
            package, _, inside = rest.partition("/")
            name = inside if inside.endswith(path.name) else posixpath.join(inside, path.name)
            return f"{head}://{package}/{posixpath.dirname(name)}"
        folder = address if not address.endswith(path.name) else posixpath.dirname(address)
        return f"{folder}/" if folder else ""


def _set_lines(element: Element, line: int) -> None:
    """A finding's line is one of the file that was asked for."""
    waiting = [element]
    while waiting:
        one = waiting.pop()
        one.line = line
        waiting += one.children


def _count(root: Element) -> int:
    count, waiting = 0, [root]
    while waiting:
        one = waiting.pop()
        count += 1
        waiting += one.children
    return count
