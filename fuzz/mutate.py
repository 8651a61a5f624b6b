"""Cases out of other cases: words exchanged for nastier ones, parts left out, doubled, nested, repeated.

libFuzzer changes bytes; these changes keep what is read as text readable for longer.
"""

from __future__ import annotations

import random
import re
from collections.abc import Sequence

TOKEN = re.compile(rb'"(?:[^"\\]|\\.)*"|[A-Za-z_][\w-]*|[-+]?\.?\d[\w.+-]*|\s+|.', re.DOTALL)
WORD = re.compile(rb"[A-Za-z_][\w-]*|\d+(?=[^\w.]|$)")

# fmt: off
NUMBERS = [
    b"0", b"-0", b"-1", b"1.0", b"1e999", b"-1e999", b"5e-324", b"1e-320", b"1e308", b"0.1", b"1_0", b"1e22",
    b"9007199254740993", b"18446744073709551616", b"268435456", b"-268435457", b"4294967296", b"65536",
    b"1e-12", b"1" * 400, b"7" * 5000, b"0." + b"0" * 400 + b"1", b"NaN", b"-Infinity", b"nan", b"inf",
    b"0x10", b"1e5", "١٢".encode(), b"1,5", b"true", b"false", b"null", b"[]", b"{}", b"255", b"256",
]
TEXTS = [
    b'""', b'"\\ud800"', b'"\\udc00\\ud800"', b'"\\ud83d\\ude00"', b'"\\u0000"', b'"\\n"', b'"__proto__"',
    b'"constructor"', b'"toString"', '"\ufeff"'.encode(), '"\u202eabc"'.encode(), '"\u2028"'.encode(),
    '"\x85"'.encode(), '"\u00a0"'.encode(), '"é"'.encode(), '"e\u0301"'.encode(), b'"*"', b'"a.b"',
    b'"../../etc/passwd"', b'"%00"', b'"%s"', b'"${x}"', b'"a\\u000ab"', b'"' + b"a" * 201 + b'"',
    b'"' + "😀".encode() * 200 + b'"', b'"1e999"', b'"0"', b'"' + b"0" * 64 + b'"', b'"-"',
    b'"' + b"A" * 43 + b'"',
]
SCRAPS = [
    b"\xef\xbb\xbf", b"\xff", b"\x00", b"\xed\xa0\x80", b"\xc3", b"\r", b"\r\n", b"\x85", "\u00a0".encode(),
    "\u2028".encode(), b"\x0b", b"\x1c", b"\x7f", b"%", b"&", b"&amp;", b"&#0;", b"&#x202e;", b"<!--", b"-->",
    b"<![CDATA[", b"]]>", b"<?xml?>", b"<", b">", b"/>", b"=", b"#", b";", b",", b"'", b'"""', b"\\", b"-",
    b"..", b"//", b"\n\n", b"[[", b"]]", b"{", b"}", b"+", b"*", b"**",
]
NESTS = [
    (b"[", b"]"), (b'{"a":', b"}"), (b"<a>", b"</a>"), (b"(", b")"), (b"[[", b"]]"), (b"{a=", b"}"),
    (b"\x81", b""), (b'{"a":[', b"]}"), (b"a.", b""), (b"../", b""), (b" ", b""), (b"\n", b""),
    (b"<!--", b"-->"), (b"\\", b""), (b"0", b""), (b'"', b'"'), (b"-", b""), (b"{", b"}"), (b"%25", b""),
    (b";", b""), (b"&a=", b""),
]
# fmt: on


def changed(data: bytes, others: Sequence[bytes], most: int, chance: random.Random) -> bytes:
    """One to four changes of some tokens; at most `most` bytes."""
    tokens = TOKEN.findall(data) or [b""]
    for _ in range(chance.choice((1, 1, 1, 2, 2, 3, 4))):
        at, run = _run(tokens, chance)
        kind = chance.randrange(9)
        if kind <= 2:
            tokens[at] = _nasty(tokens[at], chance)
        elif kind == 3:
            del tokens[at : at + run]
        elif kind == 4:
            tokens[at:at] = tokens[at : at + run]
        elif kind == 5:
            there = chance.randrange(len(tokens) + 1)
            tokens[there:there] = tokens[at : at + run]
        elif kind == 6:
            taken = TOKEN.findall(chance.choice(others)) if others else []
            if taken:
                begin, size = _run(taken, chance)
                tokens[at : at + chance.choice((0, run))] = taken[begin : begin + size]
        elif kind == 7:
            tokens.insert(at, chance.choice(SCRAPS))
        else:
            opening, closing = chance.choice(NESTS)
            deep = chance.choice((1, 2, 3, 70))
            tokens[at:at] = [opening * deep]
            tokens.insert(min(at + 1 + run, len(tokens)), closing * deep)
        if not tokens:
            tokens = [b""]
    return b"".join(tokens)[:most]


def stretched(data: bytes, chance: random.Random) -> Stretch:
    """A way to make the case longer without end: some of its tokens again and again, or something nested."""
    tokens = TOKEN.findall(data) or [b" "]
    if chance.random() < 0.25:
        at = chance.randrange(len(tokens) + 1)
        opening, closing = chance.choice(NESTS)
        return Stretch(b"".join(tokens[:at]), opening, closing, b"".join(tokens[at:]), "nested")
    at, run = _run(tokens, chance)
    before, part, after = (
        b"".join(some) for some in (tokens[:at], tokens[at : at + run], tokens[at + run :])
    )
    if chance.random() < 0.5:
        return Stretch(before, part, b"", part + after, "repeated")
    return Stretch(before, part, b"", part + after, "counted")


class Stretch:
    """`before`, then `part` so often that the whole is of the length asked for, then `after`."""

    def __init__(self, before: bytes, part: bytes, closing: bytes, after: bytes, how: str) -> None:
        self.before, self.part, self.closing, self.after, self.how = before, part, closing, after, how

    def __str__(self) -> str:
        return f"{self.part[:80]!r} {self.how} after {self.before[-80:]!r}"

    def to(self, size: int) -> bytes:
        """A case of about so many bytes."""
        room = max(0, size - len(self.before) - len(self.after))
        if self.how == "counted":
            numbered = WORD.sub(b"\\g<0>%d", self.part.replace(b"%", b"%%"))
            words = len(WORD.findall(self.part))
            pieces, long, n = [], 0, 0
            while long < room:
                pieces.append(numbered % ((n,) * words))
                long += len(pieces[-1])
                n += 1
            middle = b"".join(pieces)
        else:
            times = room // max(1, len(self.part) + len(self.closing))
            middle = self.part * times
            if self.closing:
                return self.before + middle + self.after + self.closing * times
        return self.before + middle + self.after


def _run(tokens: Sequence[bytes], chance: random.Random) -> tuple[int, int]:
    at = chance.randrange(len(tokens))
    return at, chance.choice((1, 1, 2, 3, 4, 5, 8, 13, 30, len(tokens)))


def _nasty(token: bytes, chance: random.Random) -> bytes:
    if chance.random() < 0.1:
        return chance.choice(SCRAPS)
    if token[:1] == b'"' and chance.random() < 0.8:
        if chance.random() < 0.5:
            return chance.choice(TEXTS)
        return token[:-1] + chance.choice(TEXTS)[1:]
    return chance.choice(NUMBERS if chance.random() < 0.7 else TEXTS)
