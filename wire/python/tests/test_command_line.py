"""What the programs share on the command line."""

from __future__ import annotations

import importlib.metadata
import io
import json
import subprocess
import sys
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import pytest
from posecast_wire.command_line.installation import advise_extra, find_version
from posecast_wire.command_line.parser import CommandParser, suggest
from posecast_wire.command_line.terminal import paint, print_error, wants_color

PRINTS_BOTH = """
import os, sys
from posecast_wire.command_line.terminal import open_closed_streams
open_closed_streams()
print("to stdout")
print("to stderr", file=sys.stderr)
assert sys.stdin.read() == ""
os._exit(min(os.open("/dev/null", os.O_RDONLY), 3))
"""


class Terminal(io.StringIO):
    """A stream that is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("environment", "terminal", "colored"),
    [
        ({}, True, True),
        ({}, False, False),
        ({"NO_COLOR": "1"}, True, False),
        ({"NO_COLOR": ""}, True, True),
        ({"FORCE_COLOR": "1"}, False, True),
        ({"NO_COLOR": "1", "FORCE_COLOR": "1"}, True, False),
        ({"TERM": "dumb"}, True, False),
    ],
)
def test_colour_is_for_terminals_that_want_it(
    environment: dict[str, str], terminal: bool, colored: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("NO_COLOR", "FORCE_COLOR", "TERM"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    out = Terminal() if terminal else io.StringIO()
    assert wants_color(out) is colored
    assert paint("x", "red", out) == ("\x1b[31mx\x1b[0m" if colored else "x")


def test_a_closed_stream_wants_none(monkeypatch: pytest.MonkeyPatch) -> None:
    out = io.StringIO()
    out.close()
    monkeypatch.setenv("FORCE_COLOR", "1")
    assert not wants_color(None)
    monkeypatch.delenv("FORCE_COLOR")
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert not wants_color(out)
    monkeypatch.setattr("sys.stderr", out)
    print_error("p", "nobody reads it")


@pytest.mark.parametrize("closed", ["", "<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_closed_stream_leads_nowhere_and_no_file_takes_its_place(closed: str) -> None:
    command = ["bash", "-c", f'exec "$0" -c "$1" {closed}', sys.executable, PRINTS_BOTH]
    ended = subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    assert (ended.stdout, ended.stderr) == (
        "" if ">&-" in closed.replace("2>&-", "") else "to stdout\n",
        "" if "2>&-" in closed else "to stderr\n",
    )
    assert ended.returncode == 3


@pytest.mark.parametrize(
    ("word", "known", "meant"),
    [
        ("--prot", ["--port", "--host"], " (did you mean --port?)"),
        ("docter", ["doctor", "demo"], " (did you mean doctor?)"),
        ("xyzzy", ["doctor", "demo"], ""),
        ("a", [], ""),
    ],
)
def test_what_was_probably_meant(word: str, known: list[str], meant: str) -> None:
    assert suggest(word, known) == meant


def make_parser() -> CommandParser:
    parser = CommandParser(prog="p", statuses={0: "done", 3: "no"}, version=True)
    run = parser.add_subparsers(dest="command").add_parser("run", statuses={7: "rain"})
    run.add_argument("--port", required=True)
    run.add_argument("--level", choices=("low", "high"))
    return parser


@pytest.mark.parametrize(
    ("argv", "start"),
    [
        (["rnu"], "p: unknown command 'rnu' (did you mean run?): one of run\n"),
        (["run", "--prot", "1"], "p run: unrecognized arguments: --prot (did you mean --port?)\n"),
        (["--versoin"], "p: unrecognized arguments: --versoin (did you mean --version?)\n"),
        (["run", "--prot=1"], "p run: unrecognized arguments: --prot (did you mean --port?)\n"),
        (
            ["run", "--port", "1", "--level", "hihg"],
            "p run: argument --level: invalid choice: 'hihg' (did you mean",
        ),
        (["run", "--port", "1", "--zzz"], "p: unrecognized arguments: --zzz\n"),
        (["r\x1b[2J"], "p: unknown command 'r�[2J'"),
    ],
)
def test_a_mistake_is_one_line_and_status_2(
    argv: list[str], start: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        make_parser().parse_args(argv)
    assert ended.value.code == 2
    message = capsys.readouterr().err
    assert message.startswith(start)
    assert message.count("\n") == 1


def test_abbreviations_and_what_stands_behind_two_dashes_are_no_mistakes() -> None:
    parser = CommandParser(prog="p")
    parser.add_argument("--port")
    parser.add_argument("rest", nargs="*")
    assert parser.parse_args(["--po", "1", "--", "--prot"]).rest == ["--prot"]


def test_an_abbreviation_that_is_not_taken_is_a_mistake(capsys: pytest.CaptureFixture[str]) -> None:
    parser = CommandParser(prog="p", allow_abbrev=False)
    parser.add_argument("--port")
    assert parser.parse_args(["--port=1"]).port == "1"
    with pytest.raises(SystemExit):
        parser.parse_args(["--por", "1"])
    assert capsys.readouterr().err == "p: unrecognized arguments: --por (did you mean --port?)\n"


def test_help_lists_the_exit_statuses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    statuses = make_parser().format_help().partition("\nexit status:\n")[2]
    assert [line.split() for line in statuses.splitlines()] == [["0", "done"], ["3", "no"]]
    monkeypatch.delenv("NO_COLOR")
    monkeypatch.setenv("FORCE_COLOR", "1")
    assert "\x1b[1musage\x1b[0m:" in make_parser().format_help()


class Installed:
    """A distribution."""

    def __init__(self, name: str, url: str | None, installer: str = "pip", version: str = "1.2.3") -> None:
        self.name, self.version = name, version
        self._files = {"INSTALLER": f"{installer}\n"}
        if url is not None:
            self._files["direct_url.json"] = json.dumps({"url": url})

    def read_text(self, name: str) -> str | None:
        return self._files.get(name)


def test_advice_names_what_is_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    there: dict[str, Any] = {}

    def find(name: str) -> Any:
        if name not in there:
            raise PackageNotFoundError(name)
        return there[name]

    monkeypatch.setattr(importlib.metadata, "distribution", find)
    assert (advise_extra("posecast-edge", "ros"), find_version()) == (
        "pip install 'posecast-edge[ros]'",
        "unknown",
    )
    wheel = tmp_path / "posecast_edge-1.whl"
    there["posecast-edge"] = Installed("posecast-edge", wheel.as_uri())
    assert advise_extra("posecast-edge", "ros") == "pip install 'posecast-edge[ros]'"  # the wheel is gone
    there["posecast-wire"] = Installed("posecast-wire", None, version="1.0.0")
    assert (find_version("posecast-edge"), find_version("posecast-relay")) == ("1.2.3", "1.0.0")
    wheel.touch()
    assert advise_extra("posecast-edge", "ros") == f"pip install '{wheel}[ros]'"
    there["posecast"] = Installed("posecast", None)
    assert (advise_extra("posecast-edge", "ros"), find_version()) == ("pip install 'posecast[ros]'", "1.2.3")
    there["posecast"] = Installed("posecast", None, "uv")
    monkeypatch.setattr("sys.executable", "/a b/python")
    assert advise_extra("posecast-edge", "ros") == "uv pip install --python '/a b/python' 'posecast[ros]'"
