"""notes.toml: moments and words, and what is wrong with a file, by line."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest
from posecast_relay.recording.notes import NotesError, place_notes, read_notes

FROM_MS = 1_795_000_800_000  # 2026-11-18T11:20:00Z
TO_MS = FROM_MS + 3_600_000


def placed(folder: Path, text: str) -> list[tuple[int, str]]:
    """Moments in ms since the beginning, and texts."""
    file = folder / "notes.toml"
    file.write_text(text, encoding="utf-8")
    return [(note.at_ms - FROM_MS, note.text) for note in place_notes(read_notes(file), FROM_MS, TO_MS)]


def refusal(folder: Path, text: str | bytes) -> str:
    file = folder / "notes.toml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(NotesError) as caught:
        place_notes(read_notes(file), FROM_MS, TO_MS)
    said = str(caught.value)
    assert said.isprintable()
    assert said.startswith(f"{file}")
    return said.removeprefix(f"{file}")


def test_moments_and_times_since_the_beginning(tmp_path: Path) -> None:
    local = datetime.fromtimestamp(FROM_MS / 1000 + 40, UTC).astimezone().replace(tzinfo=None)
    text = f"""\ufeff# of the lecture
[[note]]
at = 2026-11-18T11:20:10.250Z
text = "걷기"

[[note]]
at = "00:00:30"
text = '''
Two
\tlines.
'''
[[note]]
at = 2026-11-18T12:20:05+01:00
text = "first"
  [[ note ]]
at = {local.isoformat()}
text = "local"
[[note]]
at = "1:00:00"
text = "the end"
[[note]]
at = "00:01.5"
text = "minutes"
"""
    assert placed(tmp_path, text) == [
        (1500, "minutes"),
        (5000, "first"),
        (10_250, "걷기"),
        (30_000, "Two\n\tlines."),
        (40_000, "local"),
        (3_600_000, "the end"),
    ]
    assert placed(tmp_path, "") == []


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[[note]\n", ": Expected ']]' at the end of an array declaration (at line 1, column 7)"),
        (
            "[[note]]\nat = 2026-13-01T00:00:00Z\n",
            ": Expected newline or end of document after a statement (at line 2, column 10)",
        ),
        (b"\xff", ": not UTF-8"),
        ("title = 'x'\n", ": title: only [[note]] may stand here"),
        ("note = 1\n", ": note: begin each with [[note]]"),
        ("[note]\nat = '1:00'\n", ": note: begin each with [[note]]"),
        ("[[note]]\nat = '0:01'\ntext = 'x'\n\n[[note]]\ntext = 'x'\n", ", line 5: at: use at = 2026-"),
        ("[[note]]\nat = 5\ntext = 'x'\n", ", line 1: at: use at = 2026-"),
        ("[[note]]\nat = 11:20:00\ntext = 'x'\n", ", line 1: at: use at = 2026-"),
        ("[[note]]\nat = 2026-11-18\ntext = 'x'\n", ", line 1: at: use at = 2026-"),
        (
            "[[note]]\nat = '61:00:00'\ntext = 'x'\n",
            ", line 1: at: not within the recording, which is from 2026-",
        ),
        ("[[note]]\nat = 0001-01-01T00:00:00\ntext = 'x'\n", ", line 1: at: there is no such time"),
        ("[[note]]\nat = '-1:00'\ntext = 'x'\n", ", line 1: at: '-1:00': use at = "),
        ("[[note]]\nat = '0:61:00'\ntext = 'x'\n", ", line 1: at: '0:61:00': use at = "),
        ("[[note]]\nat = 2026-11-18T11:19:59Z\ntext = 'x'\n", ", line 1: at: not within the recording"),
        ("[[note]]\nat = '0:01'\n", ", line 1: text: write 1 to 2000 characters"),
        ("\n\n[[note]]\nat = '0:01'\ntext = ' \t '\n", ", line 3: text: write 1 to 2000 characters"),
        (
            "[[note]]\nat = '0:01'\ntext = '" + "x" * 2001 + "'\n",
            ", line 1: text: write 1 to 2000 characters",
        ),
        ("[[note]]\nat = '0:01'\ntext = \"a\\u0007\"\n", ", line 1: text: write 1 to 2000 characters"),
        ("[[note]]\nat = '0:01'\ntext = 'x'\nby = 'me'\n", ", line 1: by: a note has only at and text"),
        ("note = [{at = '0:01', text = 'x'}, {at = '0:01'}]\n", ", note 2: text: write 1 to 2000 characters"),
        ("[[note]]\nat = '0:01'\ntext = 'x'\n" * 1001, ": 1001 notes, 1000 allowed"),
        ("\u202e = 1\n", ": "),
    ],
)
def test_a_wrong_file_is_refused_with_line_and_reason(tmp_path: Path, text: str | bytes, says: str) -> None:
    assert refusal(tmp_path, text).startswith(says)


def test_a_file_that_is_not_there_or_too_large(tmp_path: Path) -> None:
    with pytest.raises(NotesError) as caught:
        read_notes(tmp_path / "none.toml")
    assert str(caught.value) == f"{tmp_path}/none.toml: no such file or directory"
    with (tmp_path / "large.toml").open("wb") as file:
        file.truncate((16 << 20) + 1)
    with pytest.raises(NotesError) as caught:
        read_notes(tmp_path / "large.toml")
    assert str(caught.value) == f"{tmp_path}/large.toml: over 16777216 bytes"
