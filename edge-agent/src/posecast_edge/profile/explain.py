"""Reads a profile's [explain] table: sentences that say what a bit means, in each language of the profile."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

from posecast_wire.schema import Sentence

from posecast_edge.profile.types import FieldSpec

if TYPE_CHECKING:
    from posecast_edge.profile.reader import ProfileReader

SENTENCE_MAX = 200  # characters, as on the wire
BYTES_MAX = 32 << 10  # of all sentences in UTF-8: every viewer gets them before the first frame
VALUES = ("ref", "pos", "error", "vel", "effort", "cur", "temp")  # with units, for the joint that has the bit
_OPTIONAL = re.compile(r"\[([^\[\]]*)\]")
_PLACE = re.compile(r"\{([^{}]*)\}")


def read_sentences(
    reader: ProfileReader, value: object, fields: Mapping[str, FieldSpec]
) -> dict[str, dict[str, dict[str, Sentence]]]:
    """Parse [explain] into field → bit → language → sentence. Raises ProfileError, which names the line."""
    found: dict[str, dict[str, dict[str, Sentence]]] = {}
    size = 0
    for name, entry in reader.check_table(value, "explain").items():
        where = f"explain.{name}"
        bits = fields[reader.check_choice(name, fields, "field", where)].bits
        found[name] = {}
        for bit, by_language in reader.check_table(entry, where).items():
            at = f"{where}.{bit}"
            reader.check_choice(bit, bits, "bit", at)
            found[name][bit] = _languages(reader, by_language, at)
            size += sum(len((s.say + (s.why or "")).encode()) for s in found[name][bit].values())
            if size > BYTES_MAX:
                reader.fail(at, f"more than {BYTES_MAX} bytes of sentences in all")
    return found


def _languages(reader: ProfileReader, value: object, where: str) -> dict[str, Sentence]:
    sentences: dict[str, Sentence] = {}
    for language, entry in reader.check_table(value, where).items():
        at = f"{where}.{language}"
        reader.check_language(language, at, sentences)
        item = reader.check_table(entry, at, ("say", "why"))
        say = _short(reader, item.get("say"), f"{at}.say")
        _check_places(reader, say, f"{at}.say")
        sentences[language] = Sentence(
            say, _short(reader, item["why"], f"{at}.why") if "why" in item else None
        )
    return sentences


def _short(reader: ProfileReader, value: object, where: str) -> str:
    text = reader.check_words(value, where)
    if len(text) > SENTENCE_MAX:
        reader.fail(where, f"has {len(text)} characters; at most {SENTENCE_MAX}")
    return text


def _check_places(reader: ProfileReader, say: str, where: str) -> None:
    """Check that each value is in an optional part of the sentence: it may be unknown."""
    surely, maybe = _OPTIONAL.sub("", say), _OPTIONAL.findall(say)
    for text, allowed in ((surely, ("joint",)), *((part, ("joint", "age", *VALUES)) for part in maybe)):
        for place in _PLACE.findall(text):
            if place not in ("joint", "age", *VALUES):
                known = ", ".join(("joint", "age", *VALUES))
                reader.fail(where, f"unknown place {{{place}}}; known: {known}")
            if place not in allowed:
                reader.fail(where, f"{{{place}}} may be unknown: put its part of the sentence in [ ]")
        if any(mark in _PLACE.sub("", text) for mark in "{}[]"):
            reader.fail(where, "braces and brackets must come in pairs, not nested in their own kind")
