"""Makes text from outside safe to print: one line, of bounded length, with no invisible characters."""

from __future__ import annotations

import re

LINE_MAX = 600  # characters of a line
WORD_MAX = 60  # characters of a value quoted in a line
# Unicode calls these printable, but they are invisible: fillers, joiners, variation selectors, blanks.
_UNSEEN = re.compile(
    "[\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180f\u2800\u3164\ufe00-\ufe0f\uffa0\U000e0100-\U000e01ef]"
)


def make_visible(text: str, most: int = LINE_MAX) -> str:
    """Escape characters of `text` that are invisible or change the writing direction as Python does
    (`\u202e`), and cut the result to `most` characters."""
    shown = text[: most + 1]
    if not shown.isascii() or not shown.isprintable():
        shown = "".join(_escaped(c) for c in shown)
    return shown if len(shown) <= most else f"{shown[: most - 1]}…"


def _escaped(c: str) -> str:
    if c.isprintable() and not _UNSEEN.match(c):
        return c
    return c.encode("unicode_escape").decode()


def quote(value: object, most: int = WORD_MAX) -> str:
    """`repr` of a value from outside for use in a message, cut to `most` characters. Never raises."""
    if isinstance(value, str):
        value = value[: most + 1]  # don't copy a long one whole
    try:
        shown = repr(value)
    except RecursionError:
        shown = f"a {type(value).__name__} nested too deep"
    except ValueError:  # Python refuses to print integers of more than 4300 digits
        shown = "a number with thousands of digits"
    return make_visible(shown, most)


def many(number: int, what: str) -> str:
    """`1 value`, `2 values`."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
