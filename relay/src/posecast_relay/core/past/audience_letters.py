"""Encodes audiences as letters for the names and indexes of an object store."""

from __future__ import annotations

import re
from collections.abc import Iterable

from posecast_relay.core.policy import Audience

LETTERS = {Audience.ANYONE: "a", Audience.LINK: "l", Audience.SIGNED_IN: "s"}
NOBODY = "x"
FORM = re.compile("a?l?s?|x", re.ASCII)


def write_letters(audiences: Iterable[Audience]) -> str:
    """Return one letter for each audience, sorted; x for none."""
    return "".join(sorted(LETTERS[audience] for audience in audiences)) or NOBODY


def read_letters(text: str) -> frozenset[Audience]:
    """Parse what `write_letters` wrote. Raises ValueError."""
    if not text or not FORM.fullmatch(text):
        raise ValueError("invalid audiences")
    return frozenset(audience for audience, letter in LETTERS.items() if letter in text)
