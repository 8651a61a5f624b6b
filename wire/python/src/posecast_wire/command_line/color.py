"""Colour for people: on a terminal, and as NO_COLOR (https://no-color.org) and FORCE_COLOR say."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TextIO

STYLES = {"bold": "1", "red": "31", "yellow": "33", "green": "32", "cyan": "36"}


def wants_color(out: TextIO, environment: Mapping[str, str] | None = None) -> bool:
    """Whether text written to `out` should have colours. `environment`: None for that of the process."""
    known = os.environ if environment is None else environment
    if known.get("NO_COLOR"):
        return False
    if known.get("FORCE_COLOR"):
        return True
    try:
        return out.isatty() and known.get("TERM") != "dumb"
    except ValueError:  # closed
        return False


def paint(text: str, style: str, out: TextIO, environment: Mapping[str, str] | None = None) -> str:
    """`text` in one of STYLES where `out` wants colours, else as it is."""
    return f"\x1b[{STYLES[style]}m{text}\x1b[0m" if wants_color(out, environment) else text
