"""The table of endings is the file both languages are tested against, and SPEC's."""

from __future__ import annotations

import json
from pathlib import Path

from posecast_wire import ENDINGS, Close, Retry, retry_of

WIRE = Path(__file__).resolve().parents[2]


def test_the_table_is_closes_json() -> None:
    table = [
        {"code": int(c), "key": c.name, "name": e.name, "meaning": e.meaning, "retry": e.retry.value}
        for c, e in ENDINGS.items()
    ]
    assert table == json.loads((WIRE / "closes.json").read_text(encoding="utf-8"))
    assert list(ENDINGS) == list(Close)


def test_the_specification_has_every_row() -> None:
    spec = (WIRE / "SPEC.md").read_text(encoding="utf-8")
    for c, e in ENDINGS.items():
        assert f"| {int(c)} | {e.name} | {e.meaning} | {e.retry.value} |" in spec


def test_an_unknown_ending_is_worth_another_try() -> None:
    assert [retry_of(c) for c in (1000, 1006, 4999)] == [Retry.BACKOFF] * 3
    assert retry_of(4403) == Retry.NEVER
