"""Text from outside as a person may read it: in one line, of bounded length, with nothing hidden in it."""

from __future__ import annotations

import re

LINE_MAX = 600  # characters of a line
WORD_MAX = 60  # of a value that is quoted in one
# Printable by Unicode's word, and yet nothing to be seen: fillers, joiners, selectors of variants, blanks.
_UNSEEN = re.compile(
    "[\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180f\u2800\u3164\ufe00-\ufe0f\uffa0\U000e0100-\U000e01ef]"
)


def make_visible(text: str, most: int = LINE_MAX) -> str:
    """`text` with everything that can't be seen, or turns the direction of what follows, written out as in
    Python (`\\u202e`), cut to `most` characters."""
    shown = text[: most + 1]
    if not shown.isascii() or not shown.isprintable():
        shown = "".join(_escaped(c) for c in shown)
    return shown if len(shown) <= most else f"{shown[: most - 1]}…"


def _escaped(c: str) -> str:
    if c.isprintable() and not _UNSEEN.match(c):
        return c
    return c.encode("unicode_escape").decode()


def quote(value: object, most: int = WORD_MAX) -> str:
    """A value from outside as a message quotes it: `repr`, cut; never an exception."""
    if isinstance(value, str):
        value = value[: most + 1]  # a long one is not copied whole
    try:
        shown = repr(value)
    except RecursionError:
        shown = f"a {type(value).__name__} nested too deep"
    except ValueError:  # Python writes no integer of more than 4300 digits
        shown = "a number of thousands of digits"
    return make_visible(shown, most)
