"""Profiles that somebody else wrote: a profile or one line comes of them."""

from __future__ import annotations

import random
from pathlib import Path

from edge_stage import PROFILE
from posecast_edge.profile.reader import ProfileError, parse_profile
from posecast_edge.profile.schema import make_schema_text
from posecast_wire.schema import Schema
from settings_parsers import VIEWS

STRANGE = [
    *("1e999", "-0.0", "5e-324", "nan", "9" * 450, "0x" + "f" * 500, "1979-05-27T00:00:00Z", "true"),
    *("[[", "]]", "[" * 50, "{a={a={a=1}}}", "a.b.c.d", "=", "'", '"""', "\\"),
    *('"\\ud800"', "\ufeff", "\0", "\u202e"),
]


def refusal(text: str) -> str | None:
    """Why it is no profile; None when it is one that a schema can be made of."""
    try:
        profile = parse_profile(text, "p.toml")
    except ProfileError as e:
        return str(e)
    Schema.parse(make_schema_text(profile))
    return None


def test_whatever_is_written_is_a_profile_or_one_line() -> None:
    """Profiles of ours with pieces of them, and of strangers, where they don't belong."""
    dice = random.Random(7)
    files = sorted((Path(__file__).parents[1] / "src/posecast_edge/profiles").glob("*.toml"))
    texts = [PROFILE, PROFILE + VIEWS, *(file.read_text(encoding="utf-8") for file in files)]
    verdicts = {"profile": 0, "refused": 0}
    for _ in range(1500):
        text = dice.choice(texts)
        for _ in range(dice.randint(1, 3)):
            at, size = dice.randrange(len(text)), dice.choice((0, 1, 5, 30))
            other = dice.choice(texts)
            start = dice.randrange(len(other))
            piece = dice.choice((dice.choice(STRANGE), other[start : start + dice.randint(1, 40)]))
            text = text[:at] + piece + text[at + size :]
        said = refusal(text)
        verdicts["refused" if said else "profile"] += 1
        if said:
            assert said.startswith("p.toml")
            assert said.isprintable(), said
            assert len(said) < 700
    assert min(verdicts.values()) > 20, verdicts
