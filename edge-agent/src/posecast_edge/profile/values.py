"""Checks values of a TOML document. An error is one line that names file, line and place."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from typing import Any, NoReturn, TypeVar

from posecast_wire.checked import SCRIPT_MARKS, UNSEEN
from posecast_wire.schema import Xyz
from posecast_wire.toml_lines import find_line, index_lines

from posecast_edge.kit import make_visible, quote
from posecast_edge.profile.defaults import UNITS

T = TypeVar("T")

WHERE_MAX = 120  # characters
REASON_MAX = 400
LANGUAGES_MAX = 16  # per text
_LANGUAGE = re.compile(r"[a-z]{2,3}(-[A-Za-z0-9]{2,8}){0,3}")
_BLANK = UNSEEN.union(SCRIPT_MARKS)
_WITHOUT_MARKS = {ord(mark): None for mark in SCRIPT_MARKS}


class ProfileError(ValueError):
    """An unusable profile: one line, `file:line: where: reason`. `path`: the place, as spelled in the file;
    `more`: the lines of further errors."""

    def __init__(self, line: str, path: str = "") -> None:
        super().__init__(line)
        self.path = path
        self.more: tuple[str, ...] = ()

    @property
    def lines(self) -> tuple[str, ...]:
        """All errors, one line each."""
        return (str(self), *self.more)


class Values:
    """Checks the values of one TOML document. `where` is a path such as `fields[0].name`; every method raises
    ProfileError when the value is not what it should be."""

    def __init__(self, file: str, text: str) -> None:
        self.file = file
        self._text = text
        self.field_paths: dict[str, str] = {}  # `fields.pos` → `fields[1]`

    def fail(self, where: str, reason: str) -> NoReturn:
        """Raise ProfileError with the line number of `where`."""
        path = self._path(where)
        try:
            line = find_line(index_lines(self._text), path)
        except RecursionError:  # nested too deep
            line = None
        place = self.file if line is None else f"{self.file}:{line}"
        message = f"{place}: {make_visible(where, WHERE_MAX)}: {make_visible(reason, REASON_MAX)}"
        raise ProfileError(message, path)

    def _path(self, where: str) -> str:
        """Convert `fields.pos.unit`, as in messages, to `fields[1].unit`, as in the file."""
        for shown, path in self.field_paths.items():
            if where == shown or where.startswith((f"{shown}.", f"{shown}[")):
                return path + where[len(shown) :]
        return where

    def check_table(self, value: object, where: str, keys: Sequence[str] | None = None) -> dict[str, Any]:
        """Return `value` if it is a table and, if `keys` are given, has no other keys."""
        if not isinstance(value, dict):
            self.fail(where, "must be a table")
        if keys is not None:
            for key in value:
                if key not in keys:
                    self.fail(f"{where}.{key}" if where else key, f"unknown key; known: {', '.join(keys)}")
        return value

    def check_text(self, value: object, where: str) -> str:
        """Return `value` if it is a valid text."""
        if not isinstance(value, str) or not value or not value.isprintable():
            self.fail(where, f"must be a text, not {quote(value)}")
        return value

    def check_words(self, value: object, where: str) -> str:
        """Return `value` if it is a non-blank display text in any language. In addition to `check_text`, it
        allows the joiners and direction marks that some scripts need."""
        if isinstance(value, str) and value and all(c.isspace() or c in _BLANK for c in value):
            self.fail(where, f"must not be blank, not {quote(value)}")
        if isinstance(value, str) and (seen := value.translate(_WITHOUT_MARKS)) != value:
            self.check_text(seen, where)
            return value
        return self.check_text(value, where)

    def check_language(self, tag: str, where: str, before: Collection[str]) -> str:
        """Return `tag` if it is a language tag (BCP 47) and, with those `before` it, not one too many."""
        if not _LANGUAGE.fullmatch(tag):
            self.fail(where, "must be a language tag, such as en or ko")
        if len(before) == LANGUAGES_MAX:
            self.fail(where, f"more than {LANGUAGES_MAX} languages")
        return tag

    def check_number(
        self,
        value: object,
        where: str,
        low: float = -math.inf,
        above: float = -math.inf,
        most: float = math.inf,
    ) -> float:
        """Return `value` as float if it is a finite number, at least `low`, greater than `above` and at most
        `most`."""
        number = math.nan
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            with suppress(OverflowError):  # an integer too large for a float
                number = float(value)
        if not math.isfinite(number):
            self.fail(where, f"must be a number, not {quote(value)}")
        if number < low:
            self.fail(where, f"must be at least {low:g}, not {number:g}")
        if number <= above:
            self.fail(where, f"must be above {above:g}, not {number:g}")
        if number > most:
            self.fail(where, f"must be at most {most:g}, not {number:g}")
        return number

    def check_integer(self, value: object, where: str, low: int, most: int) -> int:
        """Return `value` if it is an integer from `low` to `most`."""
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= most:
            self.fail(where, f"must be an integer from {low} to {most}, not {quote(value)}")
        return value

    def check_texts(self, value: object, where: str) -> tuple[str, ...]:
        """Return `value` as a tuple if it is a list of texts."""
        if not isinstance(value, list) or not value:
            self.fail(where, "must be a list of texts")
        return tuple(self.check_text(v, f"{where}[{i}]") for i, v in enumerate(value))

    def check_unique_texts(self, value: object, where: str) -> tuple[str, ...]:
        """Return `value` as a tuple if it is a list of texts without duplicates."""
        texts = self.check_texts(value, where)
        seen: set[str] = set()
        for i, v in enumerate(texts):
            if v in seen:
                self.fail(f"{where}[{i}]", f"{quote(v)} is listed twice")
            seen.add(v)
        return texts

    def check_xyz(self, value: object, where: str) -> Xyz:
        """Return `value` as a tuple if it is a list of three numbers."""
        if not isinstance(value, list) or len(value) != 3:
            self.fail(where, "must be three numbers")
        x, y, z = (self.check_number(v, f"{where}[{i}]") for i, v in enumerate(value))
        return (x, y, z)

    def check_unit(self, value: object, where: str) -> str:
        """Return `value` if it is a valid unit."""
        if not isinstance(value, str) or value not in UNITS:
            self.fail(where, f"unknown unit {quote(value)}; known: {', '.join(u for u in UNITS if u)}")
        return UNITS[value]

    def check_entries(
        self, value: object, where: str, known: Collection[str], what: str, read: Callable[[object, str], T]
    ) -> dict[str, T]:
        """Read a table whose keys are known names; `read` gets an entry and where it stands."""
        entries = self.check_table(value, where)
        names = frozenset(known) if entries else known
        return {
            self.check_choice(name, names, what, f"{where}.{name}"): read(entry, f"{where}.{name}")
            for name, entry in entries.items()
        }

    def check_choice(self, name: object, allowed: Collection[str], what: str, where: str) -> str:
        """Return `name` if it is one of `allowed`; `what` says in the error what kind of name it is."""
        if not isinstance(name, str) or name not in allowed:
            self.fail(where, f"unknown {what} {quote(name)}")
        return name
