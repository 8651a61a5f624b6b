"""Readers that are broken on purpose. As a program: what is found of them, as JSON."""

from __future__ import annotations

import ctypes
import io
import json
import sys
from pathlib import Path

from fuzz.campaign import campaign, load_to_lead
from fuzz.target import Differs, Target

ROUND_S = 0.75  # of each target
hoard: list[bytearray] = []


def magic(data: bytes) -> None:
    """A word that nobody guesses."""
    if data[:8] == b"posecast":
        raise KeyError("magic")


def square(data: bytes) -> None:
    """Looks every word up in a list."""
    words = data.split()
    if any(word in words[:i] for i, word in enumerate(words)):
        raise ValueError("a word stands there twice")


def greedy(data: bytes) -> None:
    """Believes what a length says."""
    if data[:1] == b"!":
        hoard.append(bytearray(b"!") * (200 << 20))


def deadly(data: bytes) -> None:
    """Takes the process along."""
    if data[:1] == b"!":
        ctypes.string_at(0)


def talkative(data: bytes) -> None:
    """Refuses, and quotes all of it."""
    raise ValueError(f"not understood: {data!r}")


def unlike(data: bytes) -> None:
    """Differs from another reader."""
    if b"e" in data:
        raise Differs("value: 1 here, 2 there")


def sound(data: bytes) -> None:
    """Nothing is wrong with it."""
    if len(data) % 2:
        raise ValueError("odd")


TARGETS = (
    Target("magic", magic),
    Target("square", square, (ValueError,), seeds=(b"a b c\n",)),
    Target("greedy", greedy),
    Target("deadly", deadly),
    Target("talkative", talkative, (ValueError,), seeds=(b"abc" * 1000,)),
    Target("unlike", unlike, seeds=(b"1e5",)),
    Target("sound", sound, (ValueError,), seeds=(b"abc",)),
)


def main(folder: str, rounds: str, *names: str) -> None:
    """Play those targets until something is found of each, at most so often. Prints what, by target."""
    waiting = [
        target for target in load_to_lead(["fuzz.tests.broken_readers"], ["fuzz"]) if target.name in names
    ]
    found: dict[str, tuple[int, list[tuple[str, str]]]] = {}
    for _ in range(int(rounds)):
        for result in campaign(waiting, ROUND_S * len(waiting), Path(folder), io.StringIO()):
            findings = [(what, str(file)) for what, file in result.findings]
            found[result.target.name] = (result.executions, findings)
        waiting = [target for target in waiting if not found[target.name][1]]
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main(*sys.argv[1:])
