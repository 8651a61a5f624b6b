"""JSON at the first door, and how what it says is quoted."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posecast_wire.checked import DEPTH_MAX, check_document, is_number, loads, make_visible

from .streams import SLOW

NESTED = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=9),
    lambda inside: st.lists(inside, max_size=4) | st.dictionaries(st.text(max_size=3), inside, max_size=4),
)


@pytest.mark.parametrize(
    ("text", "document"),
    [
        ('{"a":1,"a":2}', {"a": 2}),
        ('{"__proto__":1}', {"__proto__": 1}),
        (b"[-0, -0.0, 1e-999, 1E2]", [0, 0, 0, 100]),
        ('"\\u0000\\ud83e\\uddbe"', "\0🦾"),
        ("[" * (DEPTH_MAX - 1) + "]" * (DEPTH_MAX - 1), None),
    ],
)
def test_reads_as_browsers_do(text: str | bytes, document: object) -> None:
    found = loads(text)
    assert document is None or found == document


@pytest.mark.parametrize(
    "text",
    [
        "",
        "\ufeff1",
        b"\xef\xbb\xbf1",
        "1".encode("utf-16"),
        b'"\xed\xa0\x80"',
        '"\ud800"',
        '"\\ud800"',
        '"\\ude00\\ud83d"',
        '{"\\udfff":1}',
        '{"a":"\ud800","a":1}',
        "NaN",
        "-Infinity",
        "1e999",
        "-1e999",
        "9" * 309,
        "9" * 5000,
        "-" + "9" * 100_000,
        "[" * DEPTH_MAX + "0" + "]" * DEPTH_MAX,
        "[" * 100_000 + "]" * 100_000,
        '{"a":' * 100_000,
        "\x85",
        "[1]" * 2,
    ],
    ids=lambda text: repr(text[:9]),
)
def test_the_rest_is_one_short_line(text: str | bytes) -> None:
    with pytest.raises(ValueError, match=r"\S") as caught:
        loads(text)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 200


@SLOW
@given(NESTED)
def test_what_is_sound_passes_and_can_be_written_again(document: object) -> None:
    check_document(document)
    assert json.loads(json.dumps(document, allow_nan=False, ensure_ascii=False).encode()) == document


def test_a_number_is_no_bool_and_lies_in_its_range() -> None:
    assert [is_number(v, -1, 1) for v in (0, 0.5, 1, -1.0, -0.0)] == [True] * 5
    wrong: list[object] = [True, None, "0", 2, -1.1, 10**400, float("nan"), float("inf"), [0]]
    assert [is_number(v, -1, 1) for v in wrong] == [False] * 9


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("right knee, °C 한글 🦾", "right knee, °C 한글 🦾"),
        ("a\nb\x1b[2J\x00", r"a\u{a}b\u{1b}[2J\u{0}"),
        ("\u202eevil\u2066\u200b\u2028", r"\u{202e}evil\u{2066}\u{200b}\u{2028}"),
        ("\u3164\u2800\ufe0f", r"\u{3164}\u{2800}\u{fe0f}"),
        ("a\u00a0\ud800", r"a\u{a0}\u{d800}"),
        ("x" * 160, "x" * 160),
        ("x" * 150 + "y" * 150, "x" * 100 + "…" + "y" * 59),
    ],
)
def test_what_is_shown_of_a_strangers_text(text: str, shown: str) -> None:
    assert make_visible(text) == shown


@SLOW
@given(st.text(st.characters()))
def test_nothing_unseen_is_shown(text: str) -> None:
    assert make_visible(text).isprintable()
    assert len(make_visible(text)) <= 160 * 10
