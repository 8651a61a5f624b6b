"""Balance in exports: what is in the file, and what is said of the rest."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping
from typing import Any

import pytest

from .balance_stage import make_codes, make_manifest, make_schema_text
from .export_stage import Take, csv_of, hash_of, mcap_of

LACK = "[balance] tail has no sole, or one that can't be"


def record(
    balance: Mapping[str, Any] | None = None, step_us: int = 533_000, **changes: Any
) -> tuple[Take, dict[str, Any]]:
    """A take of a robot that stands still, and what an export of it is called with."""
    manifest = json.dumps(make_manifest(**changes))
    text = make_schema_text(balance, fields=("pos", "ftf", "ftm"))
    take = Take(text, model=hash_of(manifest), step_us=step_us)
    return take, {"models": {hash_of(manifest): manifest.encode()}}


def segments_of(take: Take, count: int = 4) -> list[tuple[str, bytes]]:
    codes = make_codes(take.schema)
    values = [code * f.scale for f in take.schema.fields for code in codes[f.start : f.start + f.size]]
    return take.record(take.encode([values] * count))


def test_a_robot_that_stands_still_has_a_capture_point() -> None:
    """It sends a frame at its first sample after each 0.5 s."""
    take, called = record()
    text, table = csv_of(segments_of(take), take.schema_text, **called)
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [row["balance.capture_point.x [m]"] for row in rows] == ["", "0.0200", "0.0200", "0.0200"]
    assert table.losses.describe() == []


@pytest.mark.parametrize(
    ("rule", "changes", "margins"),
    [
        ({"feet": ["RF", "tail"]}, {}, {""}),
        ({"feet": ["RF", "LF", "tail"], "ground": "lowest"}, {}, {"100.0"}),
        ({"feet": ["RF", "tail"]}, {"inertials": []}, set()),  # there is no column of balance
    ],
)
def test_a_foot_that_is_left_out_is_told_in_the_losses(
    rule: dict[str, Any], changes: dict[str, Any], margins: set[str]
) -> None:
    take, called = record(rule, **changes)
    segments = segments_of(take)
    text, table = csv_of(segments, take.schema_text, **called)
    rows = csv.DictReader(io.StringIO(text))
    assert {row[name] for row in rows for name in row if name == "balance.margin [mm]"} == margins
    _, messages = mcap_of(segments, take.schema_text, **called)
    line = f"balance by the model {str(take.model)[:12]}: {LACK}"
    assert table.losses.describe() == [line]
    assert messages.losses.describe() == [line]
