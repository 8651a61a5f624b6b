"""The commands that the web page tells people to type exist, as the whole installation names them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from posecast_command.completion import make_whole_parser
from posecast_edge.cli.settings import make_parser as make_agent_parser

pytestmark = pytest.mark.docs

APP = Path(__file__).resolve().parents[2] / "spa/src/app"
HINT = re.compile(r"(?<![\w.`])posecast ((?:run|model|demo|relay|edge|robots|past|convert)[^`'”\n]*)")
HINTS = sorted(
    (path.relative_to(APP).as_posix(), hint[1])
    for path in APP.rglob("*.ts*")
    for hint in HINT.finditer(path.read_text(encoding="utf-8"))
)


def test_both_languages_and_both_empty_places_have_some() -> None:
    found = {path for path, _ in HINTS}
    assert found == {
        *("robot/SelfPlots.tsx", "pages/list/RobotList.tsx", "past/save/SaveSheet.tsx"),
        *("text/more_en.ts", "text/more_ko.ts"),
    }


@pytest.mark.parametrize(("path", "hint"), HINTS)
def test_a_hint_is_a_command_with_flags_that_it_has(path: str, hint: str) -> None:
    words = hint.replace("<span>", "").split()
    parsers = [make_whole_parser()]
    if words[0] not in ("model", "convert"):
        parsers.append(make_agent_parser({}))
    for parser in parsers:  # the agent alone has the same command under its own name
        at, rest = parser, list(words)
        while at._subparsers is not None:
            at = at._subparsers._group_actions[0].choices[rest.pop(0)]  # type: ignore[index]
        flags = {word.split("<")[0] for word in rest if word.startswith("-")}
        assert flags <= set(at._option_string_actions)


def test_no_hint_of_the_page_takes_for_granted_that_the_agent_is_installed_alone() -> None:
    for path in APP.rglob("*.ts*"):
        named = re.findall(r"posecast-(?:edge|relay) (?:run|model|past)", path.read_text(encoding="utf-8"))
        assert not named, path
