"""The page's explanations are in the docs, in the same words, and exist in both languages."""

from __future__ import annotations

import re

import pytest

from tools.explained import PAGE, read_catalogue, write_page

pytestmark = pytest.mark.docs

ENGLISH, KOREAN = read_catalogue("en"), read_catalogue("ko")
TEXT = PAGE.read_text(encoding="utf-8")
# Terms that a sentence may use only with an explanation: a reader has never seen a robot.
JARGON = re.compile(
    r"\b(actuator|encoder|PWM|torque|quaternion|schema|frame|latency|odometry|gyroscope|accelerometer|firmware|wrench|URDF|deviation)\b",
    re.IGNORECASE,
)


def test_tables_are_up_to_date() -> None:
    assert write_page(TEXT, ENGLISH) == TEXT, f"{PAGE}: run `make explained`"


def test_everything_that_is_explained_has_a_table() -> None:
    assert sorted(re.findall(r"<!-- explained: (\S+) -->", TEXT)) == sorted([*ENGLISH, "flags"])


def test_a_section_that_nobody_explains_is_named() -> None:
    with pytest.raises(ValueError, match="no section 'colours'"):
        write_page("<!-- explained: colours -->\n<!-- explained end -->\n", ENGLISH)


def test_a_table_that_is_out_of_date_is_replaced() -> None:
    page = "a\n<!-- explained: sensors -->\nold\n<!-- explained end -->\nb\n"
    written = write_page(page, ENGLISH)
    assert "old" not in written
    assert "| **IMU** | Feels which way is down" in written
    assert write_page(written, ENGLISH) == written


def test_both_languages_explain_the_same_things() -> None:
    assert {s: list(entries) for s, entries in KOREAN.items()} == {s: list(e) for s, e in ENGLISH.items()}
    for catalogue in (ENGLISH, KOREAN):
        for section, entries in catalogue.items():
            for key, entry in entries.items():
                for part in ("name", "what", "how"):
                    assert 0 < len(entry[part]) <= 200, (section, key, part)
                assert {entry["what"][-1], entry["how"][-1]} == {"."}, (section, key)


def test_no_sentence_has_a_word_of_the_trade() -> None:
    said = [
        (section, key, found[0])
        for section, entries in ENGLISH.items()
        for key, entry in entries.items()
        if (found := JARGON.search(f"{entry['what']} {entry['how']}"))
    ]
    assert said == []
