"""The first door for text, and that every source goes through it."""

from __future__ import annotations

import pytest
from posecast_edge.pipeline.intake import TextGuard
from posecast_edge.sample import Sample

HALF = "\ud800"


def guarded(sample: Sample) -> tuple[Sample, list[str]]:
    said: list[str] = []
    return TextGuard(said.append).clean(sample), said


def test_a_text_that_is_none_is_named_and_the_others_stay() -> None:
    sample, said = guarded(
        Sample(
            1.0,
            {"pos": [1.0]},
            {"mode": HALF, HALF: "x", "ok": "é😀"},
            "line 7",
            links={"imu": "torso" + HALF},
        )
    )
    assert sample == Sample(1.0, {"pos": [1.0]}, {"ok": "é😀"}, "line 7")
    assert said == [
        f"line 7: {part} is left out: it is not valid Unicode (half of a surrogate pair)"
        for part in ("info 'mode'", r"info '\ud800'", "the link of 'imu'")
    ]


def test_it_is_said_once_and_counted() -> None:
    said: list[str] = []
    guard = TextGuard(said.append)
    for i in range(600):
        guard.clean(Sample(0.0, {}, {"mode": f"{HALF}{i}"}, f"line {i}"))
    assert len(said) == 3
    assert said[2].startswith("100 more invalid names and texts, the newest: line 100: info 'mode' ")


@pytest.mark.parametrize("text", [b"bytes", 5, None])
def test_what_is_not_even_a_string(text: object) -> None:
    sample, said = guarded(Sample(0.0, {}, {"mode": text}))  # type: ignore[dict-item]
    assert (sample.info, len(said)) == ({}, 1)
