"""Profiles that somebody else wrote: a profile or one line comes of them, for what they are long."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest
from cost_stage import best_s
from edge_stage import PROFILE
from posecast_edge.profile_reader import ProfileError, parse_profile
from posecast_edge.schema_build import schema_text
from posecast_wire.schema import Schema
from test_profile import BASE, VIEWS

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
    Schema.parse(schema_text(profile))
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


def _labels(n: int) -> str:
    return ", ".join(f"'j{i}'" for i in range(n))


WORST: dict[str, Callable[[int], str]] = {
    "comments": lambda n: BASE + "#\n" * n + "x=1\n",
    "unknown tables": lambda n: "".join(f"[t{i}]\n" for i in range(n)),
    "fields": lambda n: "[labels]\nl=['a']\n"
    + "".join(f"[[fields]]\nname='f{i}'\nlabels='l'\n" for i in range(n)),
    "labels": lambda n: f"[labels]\njoint=[{_labels(n)}]\n[[fields]]\nname='pos'\n",
    "a label twice": lambda n: f"[labels]\njoint=[{_labels(n)}, 'j0']\n[[fields]]\nname='pos'\n",
    "names": lambda n: f"[labels]\njoint=[{_labels(n)}]\n[[fields]]\nname='pos'\n[names]\n"
    + "".join(f"j{i}='x'\n" for i in range(n)),
    "joints": lambda n: f"[labels]\njoint=[{_labels(n)}]\n[[fields]]\nname='pos'\n[joints]\n"
    + "".join(f"k{i}.terms=[['j{i}',2]]\n" for i in range(n)),
    "joints that follow": lambda n: BASE
    + "[joints]\n" + "".join(f"j{i}.terms=[['j{i + 1}',1]]\n" for i in range(n)),
    "units": lambda n: f"[labels]\njoint=[{_labels(n)}]\n[[fields]]\nname='pos'\n"
    + "units={" + ",".join(f"j{i}='mm'" for i in range(n)) + "}\n",
    "thresholds": lambda n: f"[labels]\njoint=[{_labels(n)}]\n[[fields]]\nname='pos'\n[thresholds.pos]\n"
    + "".join(f"j{i}={{high=1}}\n" for i in range(n)),
    "tolerances": lambda n: f"[labels]\njoint=[{_labels(n)}]\n[[fields]]\nname='pos'\n[tolerance]\n"
    + "".join(f"j{i}=1\n" for i in range(n)),
    "columns": lambda n: f"[labels]\njoint=[{_labels(n)}]\n[[fields]]\nname='pos'\n"
    + f"[trajectory]\nrate_hz=1\ncolumns=[{_labels(n)}]\n",
    "a view": lambda n: "[labels]\nl=['a']\n"
    + "".join(f"[[fields]]\nname='f{i}'\nlabels='l'\n" for i in range(n))
    + "[views.lab]\nfields=[" + ", ".join(f"'f{i}'" for i in range(n)) + "]\n",
    "a dotted key": lambda n: BASE + "a." * n + "b=1\n",
    "a dotted header": lambda n: BASE + "[" + "a." * n + "b]\n",
    "many dots": lambda n: BASE + "x=[" + "0.5, " * n + "]\n",
    "a long word": lambda n: BASE + "a" * n + "\n",
    "quotes": lambda n: BASE + "x=" + "'" * n + "\n",
    "digits": lambda n: BASE + "scale=" + "9" * n + "\n",
    "underscores": lambda n: BASE + "scale=" + "1_" * n + "1\n",
    "brackets": lambda n: BASE + "x=" + "[" * n + "\n",
    "blanks": lambda n: BASE + "scale=1" + " " * n + "x\n",
}  # fmt: skip


@pytest.mark.parametrize("kind", WORST)
def test_a_profile_costs_what_it_is_long(kind: str) -> None:
    def seconds(n: int) -> float:
        text = WORST[kind](n)
        return best_s(lambda: refusal(text), 3)

    assert seconds(4000) < 16 * 3 * seconds(250) + 0.02
