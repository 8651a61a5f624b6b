from __future__ import annotations

import random

import pytest

from fuzz.mutate import changed, stretched

SEED = b'{"type":"schema","labels":{"joint":["a","b"]},"scale":0.001}'


def test_keeps_to_the_length() -> None:
    chance = random.Random(1)
    found = {changed(SEED, [SEED, b""], 200, chance) for _ in range(2000)}
    assert max(map(len, found)) <= 200
    assert len(found) > 1000


@pytest.mark.parametrize(
    "scrap", [b"\\ud800", b"5e-324", b"1e999", b"\xef\xbb\xbf", b"__proto__", b"7" * 5000]
)
def test_knows_what_readers_trip_over(scrap: bytes) -> None:
    chance = random.Random(1)
    assert any(scrap in changed(SEED, [], 10_000, chance) for _ in range(2000))


def test_stretches_to_the_length_asked_for() -> None:
    chance = random.Random(1)
    for _ in range(100):
        how = stretched(SEED, chance)
        assert 0.8 * 10_000 < len(how.to(10_000)) < 1.2 * 10_000, str(how)


def test_counts_through_what_it_repeats() -> None:
    chance = random.Random(1)
    cases = (stretched(SEED, chance).to(2000) for _ in range(1000))
    assert any(b'"a0","a1","a2"' in case or b'"b0","b1","b2"' in case.replace(b'"]', b'"') for case in cases)


def test_empty_cases_can_be_changed_too() -> None:
    chance = random.Random(1)
    assert changed(b"", [], 100, chance) is not None
    assert stretched(b"", chance).to(100) is not None
