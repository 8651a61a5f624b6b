"""Reads XML from untrusted files as small trees with line numbers.

Document types are refused, so there are no entities and nothing external is loaded. Elements are counted
while reading, so a hostile file is rejected early.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import BinaryIO
from xml.parsers import expat

from posecast_edge.model.finding import Finding, ModelRefused
from posecast_edge.model.text import Text, read_text

CHUNK = 1 << 20
PREFIXES_MAX = 1000  # of namespaces, as in the page: a browser searches all of them for each element
TOKEN_MAX = 2 << 20  # bytes of one tag with its attributes: expat parses it again with every chunk

PREFIX = re.compile(r"([\w.-]+):[\w.-]+", re.ASCII)

NO_ATTRIBUTES: Mapping[str, str] = {}


class _RootReached(Exception):
    def __init__(self, tag: str) -> None:
        super().__init__(tag)
        self.tag = tag


class Element:
    """One element. `text`: the characters directly inside it, "" unless requested."""

    __slots__ = ("_firsts", "attributes", "children", "line", "tag", "text")

    def __init__(self, tag: str, attributes: Mapping[str, str], line: int) -> None:
        self.tag = tag
        self.attributes = attributes or NO_ATTRIBUTES  # hundreds of thousands may have none
        self.children: Sequence[Element] = ()
        self.line = line
        self.text = ""
        self._firsts: dict[str, Element] | None = None  # by tag, made when first asked for

    def add(self, child: Element) -> None:
        """Append a child."""
        if isinstance(self.children, list):
            self.children.append(child)
        else:
            self.children = [child]

    def find_all(self, tag: str) -> Iterator[Element]:
        """Yield the children with this tag."""
        return (c for c in self.children if c.tag == tag)

    def find_first(self, *path: str) -> Element | None:
        """Follow a path of tags: the first child with the first tag, its first child with the next tag, and
        so on."""
        found: Element | None = self
        for tag in path:
            if found is None:
                return None
            found = found._first(tag)
        return found

    def _first(self, tag: str) -> Element | None:
        """Without a look at each child: one element may be asked for from thousands of places."""
        if self._firsts is None:
            self._firsts = {}
            for child in self.children:
                self._firsts.setdefault(child.tag, child)
        return self._firsts.get(tag)

    def get(self, name: str) -> str | None:
        """The value of an attribute, or None."""
        return self.attributes.get(name)


def read_xml(
    source: BinaryIO,
    *,
    bytes_max: int,
    elements_max: int,
    depth_max: int,
    texts: bool = False,
    findings: list[Finding] | None = None,
) -> Element:
    """Read a whole tree. Raises ModelRefused, which says what is wrong and on which line.

    `texts`: keep character data too (bounded by `bytes_max`); `findings`: gets what is
    odd about the encoding.
    """
    text = read_text(read_at_most(source, bytes_max))
    if findings is not None:
        findings += text.findings
    return parse_xml(text, elements_max=elements_max, depth_max=depth_max, texts=texts)


def read_at_most(source: BinaryIO, bytes_max: int) -> bytes:
    """Read a stream. Raises ModelRefused when it is larger."""
    data = source.read(bytes_max + 1)
    if len(data) > bytes_max:
        raise ModelRefused(f"larger than {bytes_max / (1 << 20):g} MiB")
    return data


def parse_xml(text: Text, *, elements_max: int, depth_max: int, texts: bool = False) -> Element:
    """The tree of a decoded text. Raises ModelRefused, which says what is wrong and on which line."""
    parser = expat.ParserCreate("utf-8")
    parser.buffer_text = True
    stack: list[Element] = []
    pieces: list[list[str]] = []
    root: list[Element] = []
    prefixes: set[str] = set()
    count = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if count > elements_max:
            raise ModelRefused(f"more than {elements_max} elements", parser.CurrentLineNumber)
        prefixes.update(_prefixes(tag, attributes))
        if len(prefixes) > PREFIXES_MAX:
            raise ModelRefused(f"more than {PREFIXES_MAX} prefixes", parser.CurrentLineNumber)
        if len(stack) >= depth_max:
            raise ModelRefused(f"nested more than {depth_max} deep", parser.CurrentLineNumber)
        element = Element(tag, attributes, parser.CurrentLineNumber)
        if stack:
            stack[-1].add(element)
        else:
            root.append(element)
        stack.append(element)
        pieces.append([])

    def end(_tag: str) -> None:
        stack.pop().text = "".join(pieces.pop())

    def characters(text: str) -> None:
        pieces[-1].append(text)

    def doctype(*_: object) -> None:
        raise ModelRefused("a document type (DTD) is not accepted", parser.CurrentLineNumber)

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = doctype
    parser.EntityDeclHandler = doctype
    if texts:
        parser.CharacterDataHandler = characters
    try:
        for to in range(CHUNK, len(text.utf8) + CHUNK, CHUNK):
            parser.Parse(text.utf8[to - CHUNK : to], False)
            if min(to, len(text.utf8)) - parser.CurrentByteIndex > TOKEN_MAX:
                raise ModelRefused(f"a tag larger than {TOKEN_MAX >> 20} MiB", parser.CurrentLineNumber)
        parser.Parse(b"", True)
    except expat.ExpatError as e:
        if (
            root and not stack
        ):  # it is whole; what follows its end is rubbish that other readers pass over too
            return root[0]
        raise ModelRefused(f"not XML: {expat.ErrorString(e.code)}", e.lineno) from None
    return root[0]


def read_root_tag(text: Text) -> str | None:
    """The root element's tag; None where there is none."""
    parser = expat.ParserCreate("utf-8")

    def start(tag: str, _attributes: dict[str, str]) -> None:
        raise _RootReached(tag)

    parser.StartElementHandler = start
    try:
        parser.Parse(text.utf8[:CHUNK], False)
    except _RootReached as e:
        return e.tag
    except expat.ExpatError:
        return None  # its reader reports the problem
    return None


def _prefixes(tag: str, attributes: Mapping[str, str]) -> Iterator[str]:
    """Of the names of an element."""
    for name in (tag, *attributes):
        if ":" in name and (match := PREFIX.match(name)):
            yield match[1]
