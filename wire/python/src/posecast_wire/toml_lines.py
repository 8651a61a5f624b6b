"""Finds the line number of each key and list item in a TOML text, which Python's parser does not report.

Expects text that has been parsed successfully; it is scanned only for positions. Does no I/O.
"""

from __future__ import annotations

import re
from bisect import bisect_left

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_SCALAR = re.compile(r"[^,\]}\s#][^,\]}\n#]*")
_STRING = re.compile(r'"""(?:[^\\]|\\.)*?"{3,5}|\'\'\'.*?\'{3,5}|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'', re.DOTALL)


def index_lines(text: str) -> dict[str, int]:
    """Map each path to its line number, counted from 1. Paths look like `fields[0].name`, with keys
    unquoted."""
    walk = _Walk(text)
    walk.document()
    return walk.lines


def find_line(lines: dict[str, int], path: str) -> int | None:
    """The line of `path`, or of the nearest enclosing table or list that has one."""
    while path:
        if path in lines:
            return lines[path]
        cut = max(path.rfind("."), path.rfind("["))
        path = path[: max(cut, 0)]
    return None


class _Walk:
    def __init__(self, text: str) -> None:
        self._text = text
        self._ends = [found.start() for found in re.finditer("\n", text)]
        self._at = 0
        self._counts: dict[str, int] = {}  # of each array of tables
        self.lines: dict[str, int] = {}

    def document(self) -> None:
        table = ""
        while self._skip(_BLANK) < len(self._text):
            if self._text[self._at] == "[":
                table = self._header()
            else:
                self._pair(table)

    def _skip(self, pattern: re.Pattern[str]) -> int:
        found = pattern.match(self._text, self._at)
        if found:
            self._at = found.end()
        return self._at

    def _mark(self, path: str, at: int) -> None:
        self.lines.setdefault(path, bisect_left(self._ends, at) + 1)

    def _header(self) -> str:
        start = self._at
        several = self._text.startswith("[[", start)
        self._at += 2 if several else 1
        path = ""
        keys = self._keys()
        for i, key in enumerate(keys):
            path = f"{path}.{key}" if path else key
            if several and i == len(keys) - 1:
                self._counts[path] = self._counts.get(path, -1) + 1
            if path in self._counts:
                path = f"{path}[{self._counts[path]}]"
        self._at += 2 if several else 1
        self._mark(path, start)
        return path

    def _keys(self) -> list[str]:
        """A dotted key; leaves the place after it."""
        keys = []
        while True:
            self._skip(_SPACE)
            found = _STRING.match(self._text, self._at) or _BARE.match(self._text, self._at)
            assert found is not None
            self._at = found.end()
            key = found[0]
            keys.append(key[1:-1] if key[0] in "\"'" else key)
            self._skip(_SPACE)
            if not self._text.startswith(".", self._at):
                return keys
            self._at += 1

    def _pair(self, table: str) -> None:
        start = self._at
        path = table
        for key in self._keys():
            path = f"{path}.{key}" if path else key
            self._mark(path, start)
        self._at += 1  # the =
        self._skip(_SPACE)
        self._value(path)

    def _value(self, path: str) -> None:
        opening = self._text[self._at]
        if opening == "[":
            self._at += 1
            i = 0
            while self._text[self._skip(_BLANK)] != "]":
                self._mark(f"{path}[{i}]", self._at)
                self._value(f"{path}[{i}]")
                self._comma()
                i += 1
            self._at += 1
        elif opening == "{":
            self._at += 1
            while self._text[self._skip(_BLANK)] != "}":
                self._pair(path)
                self._comma()
            self._at += 1
        else:
            self._skip(_STRING if opening in "\"'" else _SCALAR)

    def _comma(self) -> None:
        if self._text[self._skip(_BLANK)] == ",":
            self._at += 1
