from __future__ import annotations

import pytest
from posecast_edge.kit import LINE_MAX, make_visible, quote


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("left knee", "left knee"),
        ("Knie, 왼쪽 무릎, ركبة", "Knie, 왼쪽 무릎, ركبة"),
        ("a\nposecast-edge: on air", "a\\nposecast-edge: on air"),
        ("\x1b[2J", "\\x1b[2J"),
        ("abc\u202edef\u2066", "abc\\u202edef\\u2066"),  # what turns the direction
        ("a\u200bb\ufeff\u3164\u2800\ufe0f", "a\\u200bb\\ufeff\\u3164\\u2800\\ufe0f"),  # what can't be seen
        ("half \ud800 a pair", "half \\ud800 a pair"),
        ("\U000e0041\U000e0100", "\\U000e0041\\U000e0100"),
    ],
)
def test_what_is_hidden_is_written_out(text: str, shown: str) -> None:
    assert make_visible(text) == shown
    make_visible(text).encode()


def test_every_line_has_an_end() -> None:
    assert len(make_visible("x" * 10_000_000)) == LINE_MAX
    assert len(make_visible("\u202e" * 10_000)) <= LINE_MAX
    assert make_visible("x" * 5, 5) == "xxxxx"
    assert make_visible("x" * 6, 5) == "xxxx…"


def test_any_value_can_be_quoted() -> None:
    deep: list[object] = []
    for _ in range(100_000):
        deep = [deep]
    assert quote("a\u202e") == "'a\\u202e'"
    assert quote(10**5000) == "a number with thousands of digits"
    assert quote(deep) == "a list nested too deep"
    assert len(quote("x" * 10_000_000)) <= 60
    assert len(quote(list(range(10_000)))) <= 60
