from __future__ import annotations

import sys
from pathlib import Path

import pytest
from posecast_wire.toml_lines import find_line, index_lines

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PROFILES = Path(__file__).resolve().parents[3] / "edge-agent/src/posecast_edge/profiles"

TEXT = '''# a comment with [brackets] and x = 1
title = "a # no comment ] }"
[robot] # why
name = """
several
lines "quoted" """
"quoted.key" = 'C:\\'
[labels]
joint = [ # first
  "A", "B",  # two
  [1, 2],

  { x = 1, y = [3,
    4] },
]
[[fields]]
name = "ref"
[[fields]]
name = "pos"
units.A = "mm"
[joints.K.deeper]
when = 1979-05-27T07:32:00Z
'''


def test_every_key_and_item_has_its_line() -> None:
    assert index_lines(TEXT) == {
        "title": 2, "robot": 3, "robot.name": 4, "robot.quoted.key": 7, "labels": 8, "labels.joint": 9,
        "labels.joint[0]": 10, "labels.joint[1]": 10, "labels.joint[2]": 11, "labels.joint[2][0]": 11,
        "labels.joint[2][1]": 11, "labels.joint[3]": 13, "labels.joint[3].x": 13, "labels.joint[3].y": 13,
        "labels.joint[3].y[0]": 13, "labels.joint[3].y[1]": 14,
        "fields[0]": 16, "fields[0].name": 17, "fields[1]": 18, "fields[1].name": 19,
        "fields[1].units": 20, "fields[1].units.A": 20, "joints.K.deeper": 21, "joints.K.deeper.when": 22,
    }  # fmt: skip


def test_what_is_not_there_is_named_by_what_is_around_it() -> None:
    lines = index_lines(TEXT)
    assert find_line(lines, "fields[1].scale") == 18
    assert find_line(lines, "labels.joint[9]") == 9
    assert find_line(lines, "nowhere") is None
    assert find_line(lines, "") is None


@pytest.mark.parametrize("path", sorted(PROFILES.glob("*.toml")), ids=lambda p: p.stem)
def test_a_real_profile(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    lines = index_lines(text)
    rows = text.splitlines()

    def check(value: object, where: str) -> None:
        if isinstance(value, dict):
            for key, inner in value.items():
                at = f"{where}.{key}" if where else key
                if at in lines:  # a table without a header of its own has none
                    assert key in rows[lines[at] - 1]
                check(inner, at)
        elif isinstance(value, list):
            for i, inner in enumerate(value):
                check(inner, f"{where}[{i}]")
        else:
            assert str(value)[:4] in rows[lines[where] - 1], where

    check(tomllib.loads(text), "")
