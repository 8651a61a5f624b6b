"""Everything that is wrong with a profile is told at once."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_stage import run_edge
from posecast_edge.profile.reader import ERRORS_MAX, READ_BYTES_MAX, ProfileError, parse_profile

PROFILE = """\
[labels]
joint = ["hip", "knee"]

[[fields]]
name = "pos"
unit = "radd"
deadband = -1

[[fields]]
name = "flags"
labels = "joint"
bits = ["over", "over"]

[sensors]
imu = { kind = "imo", xyz = [0, "a", 0] }

[severity.flags]
over = "bad"

[thresholds.pos]
knee = { warning = 1 }

[tolerance]
kne = 0.1
"""
PLACES = [
    "fields.flags.bits[1]",
    "fields.pos.deadband",
    "fields.pos.unit",
    "sensors.imu.kind",
    "thresholds.pos.knee.warning",
    "tolerance.kne",
]


def errors(text: str) -> list[str]:
    """All lines, without the file's name."""
    with pytest.raises(ProfileError) as caught:
        parse_profile(text, "p")
    return [line.removeprefix("p:") for line in caught.value.lines]


def test_all_of_them_with_their_lines() -> None:
    places = [line.partition(": ")[2].partition(": ")[0] for line in errors(PROFILE)]
    assert sorted(places) == PLACES
    lines = {line.partition(": ")[2].partition(": ")[0]: line.partition(":")[0] for line in errors(PROFILE)}
    assert (lines["fields.pos.unit"], lines["fields.pos.deadband"], lines["tolerance.kne"]) == (
        "6",
        "7",
        "24",
    )


def test_what_only_follows_is_not_told() -> None:
    text = PROFILE.replace('unit = "radd"\ndeadband = -1\n', "").replace("imo", "imu").replace('"a"', "0")
    assert [line for line in errors(text) if "severity" in line] == []


@pytest.mark.parametrize(
    "text",
    ["", "fields = 3", "[[fields]]", "[[fields]]\nname = 1", "fields = [1]"],
)
def test_where_nothing_can_be_taken_out_one_is_all(text: str) -> None:
    assert len(errors(text)) == 1


def test_there_is_an_end() -> None:
    text = "[[fields]]\nname = 'x'\n" + "".join(f"key{n} = 1\n" for n in range(100))
    assert len(errors(text)) == ERRORS_MAX
    assert len(errors(text + "#" * READ_BYTES_MAX)) == 1


def test_the_commands_print_each(tmp_path: Path) -> None:
    profile = tmp_path / "robot.toml"
    profile.write_text(PROFILE)
    told = {
        run_edge(*argv, "--profile", str(profile)).stderr
        for argv in (
            ("doctor",),
            ("probe", "demo"),
            ("run", "--robot", "r", "--source", "demo", "--relay", "tcp/a:1"),
        )
    }
    assert len(told) == 1
    assert [line.startswith(f"posecast-edge: {profile}:") for line in told.pop().splitlines()] == [
        True
    ] * len(PLACES)
