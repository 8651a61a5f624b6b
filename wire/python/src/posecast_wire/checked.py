"""Checks values of JSON from untrusted senders; an error is one short line that says where and why."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator
from typing import NoReturn, TypeGuard, cast

TEXT_MAX = 200  # characters in any one name
DEPTH_MAX = 64  # levels of a document, itself the first
SHOWN_MAX = 160  # characters of a place or a reason in a line
SURROGATE = re.compile("[\ud800-\udfff]")
UNFIT = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udfff]")
# invisible, although Python counts them as printable: joiners, fillers, variation selectors
UNSEEN = frozenset("\u034f\u115f\u1160\u17b4\u17b5\u180b\u180c\u180d\u180f\u2800\u3164\uffa0")
UNSEEN |= frozenset(map(chr, (*range(0xFE00, 0xFE10), *range(0xE0100, 0xE01F0))))
# zero-width non-joiner and joiner, left-to-right and right-to-left mark: unseen, and yet part of how Persian,
# Hindi, Sinhala or Hebrew is written, so they stay where those scripts use them (SPEC §2)
SCRIPT_MARKS = "\u200c\u200d\u200e\u200f"
_JOINER, _AS_PICTURE = "\u200d", "\ufe0f"
# Arabic to Sinhala, Myanmar, Khmer and Mongolian, Arabic presentation forms
_JOINED = re.compile("[\u0600-\u0dff\u1000-\u109f\u1780-\u18af\ufb50-\ufdff\ufe70-\ufefc]")
_PICTURE = re.compile("[\u2190-\u21ff\u2300-\u23ff\u2600-\u27bf\u2b00-\u2bff\U0001f000-\U0001faff]")
_RIGHT_TO_LEFT = re.compile(
    "[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufefc\U00010800-\U00010fff\U0001e800-\U0001efff]"
)


class SchemaError(ValueError):
    """An unusable schema: one line, `where: reason`."""


def fail(where: str, reason: str) -> NoReturn:
    """Raise SchemaError with the text `where: reason`."""
    raise SchemaError(f"{make_visible(where)}: {make_visible(reason)}")


def make_visible(text: str) -> str:
    """Make untrusted text safe for a one-line message: at most 160 characters, escaped by `escape_unseen`."""
    if len(text) > SHOWN_MAX:
        text = f"{text[: SHOWN_MAX - 60]}…{text[-59:]}"
    return escape_unseen(text)


def escape_unseen(text: str, escape: Callable[[str], str] = lambda c: f"\\u{{{ord(c):x}}}") -> str:
    """Escape invisible characters and those that change the writing direction, except where a script uses
    them: joiners between letters of scripts that need them and in emoji, and direction marks in a text with
    right-to-left letters (SPEC §2)."""
    if text.isprintable() and UNSEEN.isdisjoint(text):
        return text
    kept = "\u200e\u200f" if _RIGHT_TO_LEFT.search(text) else ""
    return "".join(
        c if c in kept or (c.isprintable() and c not in UNSEEN) or _is_written(text, i) else escape(c)
        for i, c in enumerate(text)
    )


def _is_written(text: str, at: int) -> bool:
    """Whether the character at this place joins letters or pictures beside it."""
    mark, before, after = text[at], text[at - 1 : at], text[at + 1 : at + 2]
    if mark == _AS_PICTURE:
        return _PICTURE.match(before) is not None
    if mark in SCRIPT_MARKS[:2] and _JOINED.match(before) and _JOINED.match(after):
        return True
    if before == _AS_PICTURE and at > 1:
        before = text[at - 2]
    return mark == _JOINER and _PICTURE.match(before) is not None and _PICTURE.match(after) is not None


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not JSON")


def loads(text: str | bytes) -> object:
    """Parse JSON as browsers do. Raises ValueError for invalid JSON and for what `check_document` refuses
    (SPEC §1)."""
    if isinstance(text, bytes):
        text = text.decode()  # json would guess UTF-16, and accept half a surrogate pair
    if not is_unicode(text):
        raise ValueError("not Unicode")
    try:
        document = cast(object, json.loads(text, parse_constant=_refuse_constant))
    except RecursionError:
        raise ValueError("nested too deeply") from None
    check_document(document)
    return document


def check_document(document: object) -> None:
    """Raise ValueError when parsed JSON contains something that not every reader can parse or write again: a
    text that is not valid Unicode, a number that is not finite as a double, or more than 64 levels of
    nesting.

    Takes time in proportion to the document and does not recurse.
    """
    level = [document]
    for _ in range(DEPTH_MAX):
        try:
            level = _checked(level)
        except OverflowError:  # an integer too large for a double
            raise ValueError("a number that is not finite") from None
        if not level:
            return
    raise ValueError(f"more than {DEPTH_MAX} levels")


def _checked(level: list[object]) -> list[object]:
    """Return the values inside the values of a level, after checking the level itself."""
    inside: list[object] = []
    for value in level:
        if isinstance(value, str):
            if not is_unicode(value):
                raise ValueError("a text that is not Unicode")
        elif isinstance(value, dict):
            inside += value
            inside += value.values()
        elif isinstance(value, list):
            inside += value
        elif isinstance(value, (int, float)) and not math.isfinite(value):
            raise ValueError("a number that is not finite")
    return inside


def is_unicode(text: str) -> bool:
    """Whether `text` can be encoded as UTF-8, that is, contains no half of a surrogate pair."""
    return text.isascii() or SURROGATE.search(text) is None


def is_text(value: object) -> TypeGuard[str]:
    """Whether `value` is a text of 1 to 200 characters without control characters and halves of surrogate
    pairs."""
    return isinstance(value, str) and 0 < len(value) <= TEXT_MAX and UNFIT.search(value) is None


def is_number(value: object, low: float, high: float) -> TypeGuard[float]:
    """Whether `value` is a number from `low` to `high`; True and False are not numbers."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and low <= value <= high


def check_table(value: object, where: str) -> dict[str, object]:
    """Return `value` if it is an object; None becomes an empty one. Raises SchemaError."""
    if value is None:
        return {}
    if not isinstance(value, dict):
        fail(where, "must be an object")
    return value


def check_entries(value: object, where: str) -> Iterator[tuple[str, object, str]]:
    """Yield (name, value, where it stands) for each member of an object, checking that names are texts; None
    counts as an empty object. Raises SchemaError."""
    for name, found in check_table(value, where).items():
        yield check_text(name, f"{where} key"), found, f"{where}.{name}"


def check_list(value: object, where: str) -> list[object]:
    """Return `value` if it is a list. Raises SchemaError."""
    if not isinstance(value, list):
        fail(where, "must be a list")
    return value


def check_text(value: object, where: str) -> str:
    """Return `value` if it is a text as in `is_text`. Raises SchemaError."""
    if not is_text(value):
        fail(where, f"must be a text of 1 to {TEXT_MAX} characters without control characters")
    return value


def check_number(value: object, where: str) -> float:
    """Return `value` as float if it is a finite number. Raises SchemaError."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        fail(where, "must be a number")
    try:
        result = float(value)
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        fail(where, "must be a finite number")
    return result


def check_texts(value: object, where: str, most: int) -> tuple[str, ...]:
    """Return `value` as a tuple if it is a list of at most `most` texts without duplicates. Raises
    SchemaError."""
    listed = check_list(value, where)
    if len(listed) > most:
        fail(where, f"more than {most} names")
    found: dict[str, None] = {}
    for i, item in enumerate(listed):
        name = check_text(item, f"{where}[{i}]")
        if name in found:
            fail(where, f"'{name}' appears twice")
        found[name] = None
    return tuple(found)
