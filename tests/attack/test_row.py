"""The criteria for an attack's result."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.attack.document import BEGIN, END, FILE, put, text
from tests.attack.figure import Figure
from tests.attack.row import Row, held_up_s, longest_gap_s, misses, shares

FINE = Row("flood", "a flood", "3/s", 1.0, 0.05, 0.02, 1.0, 0.0, 0)


def test_a_row_as_promised_has_no_miss() -> None:
    assert misses(FINE, None) == []


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"share": 0.94}, "94% of the frames"),
        ({"gap_s": 0.31}, "0.31 s without a frame"),
        ({"newcomer_s": 2.1}, "2.10 s to a newcomer's first frame"),
        ({"growth_mb": 61.0}, "grew by 61 MB"),
        ({"lines_per_s": 10.5}, "10 lines a second"),
        ({"tracebacks": 1}, "1 tracebacks"),
        ({"words": ("HOLDING",)}, "its viewer read HOLDING"),
        ({"ended": True}, "the relay ended"),
        ({"failed": "it said nothing"}, "the attacker failed: it said nothing"),
    ],
)
def test_each_promise_that_is_broken_is_one_line(change: dict[str, object], says: str) -> None:
    found = misses(replace(FINE, **change), None)  # type: ignore[arg-type]
    assert len(found) == 1
    assert found[0].startswith("flood: ")
    assert says in found[0]


def test_what_the_machine_itself_held_up_is_not_the_attacks() -> None:
    stuttering = replace(FINE, gap_s=0.5, share=0.9)
    assert misses(replace(FINE, gap_s=0.49, share=0.86), stuttering) == []
    assert misses(replace(FINE, gap_s=0.51, share=0.85), stuttering) != []
    assert misses(replace(FINE, gap_s=0.6, held_up_s=0.31), None) == []


def test_frames_count_when_they_come_in_time() -> None:
    sent = [(seq, seq / 10) for seq in range(20)]
    came = [(seq, seq / 10 + 0.01) for seq in range(20) if seq != 5]
    assert shares(sent, came, 0.0, 1.35) == 10 / 11  # those of the last 0.3 s may be in transit
    assert shares(sent, [], 0.0, 1.0) == 0.0
    assert shares([], [], 0.0, 1.0) == 0.0


def test_a_gap_may_lie_at_either_end() -> None:
    assert longest_gap_s([1.0, 1.1], 0.0, 1.2) == 1.0
    assert longest_gap_s([0.1], 0.0, 2.0) == 1.9
    assert longest_gap_s([], 0.0, 2.0) == 2.0
    assert held_up_s([0.0, 0.1, 0.2], 0.1, 0.0, 0.3) == 0.0


def test_the_table_replaces_the_one_before_and_nothing_else() -> None:
    document = f"a\n{BEGIN}old\n{END}b\n"
    table = text([FINE], [Figure("p99", 1.1, 1.25, "×")])
    made = put(document, table)
    assert made == put(made, table)
    assert made.startswith("a\n")
    assert made.endswith("b\n")
    assert "old" not in made
    assert "| a flood | 3/s | 100.0% | 0.05 |" in made
    assert "| p99 | 1.10 × | ≤ 1.25 × |" in made
    with pytest.raises(ValueError, match="no place"):
        put("a", table)
    assert put(FILE.read_text(), table) != FILE.read_text()
