"""One command: the same programs, under names that are true."""

from __future__ import annotations

import io
import logging
import os
import re
import subprocess
import sys
import threading
from contextlib import redirect_stderr, redirect_stdout
from importlib.metadata import version

import pytest
from posecast_command.main import main
from posecast_command.ports import PAGE_PORT
from posecast_command.programs import EDGE, RELAY, make_parser
from posecast_edge.sources.registry import split_spec


def posecast(*argv: str) -> subprocess.CompletedProcess[str]:
    """In this process, which it would end and whose logging it sets up."""
    out, err, root = io.StringIO(), io.StringIO(), logging.getLogger()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, "argv", ["posecast", *argv])
        patch.setattr(os, "_exit", sys.exit)
        patch.setattr(root, "handlers", [])
        patch.setattr(threading, "excepthook", threading.excepthook)
        patch.setenv("COLUMNS", "80")
        with pytest.raises(SystemExit) as ended:
            main()
    return subprocess.CompletedProcess(argv, int(ended.value.code or 0), out.getvalue(), err.getvalue())


@pytest.mark.parametrize(
    ("argv", "usage"),
    [
        (("demo",), "posecast demo"),
        (("run",), "posecast run"),
        (("relay", "run"), "posecast relay run"),
        (("relay", "past", "list"), "posecast relay past list"),
        (("past", "list"), "posecast past list"),
        (("convert",), "posecast convert"),
        (("relay", "convert"), "posecast relay convert"),
        (("edge", "run"), "posecast edge run"),
        (("edge", "probe"), "posecast edge probe"),
        (("probe",), "posecast probe"),
        (("doctor",), "posecast doctor"),
        (("model", "build"), "posecast model build"),
        (("profile", "new"), "posecast profile new"),
    ],
)
def test_help_is_of_the_name_that_was_typed(argv: tuple[str, ...], usage: str) -> None:
    told = posecast(*argv, "--help")
    assert told.stdout.startswith(f"usage: {usage} ")
    assert (told.returncode, told.stderr) == (0, "")


@pytest.mark.parametrize("argv", [(), ("demo",), ("run",)])
def test_help_fits_a_terminal_and_its_examples_are_right(argv: tuple[str, ...]) -> None:
    text = posecast(*argv, "--help").stdout
    assert max(map(len, text.splitlines())) <= 80
    whole = " ".join(text.split())
    for command in re.findall(r"`posecast (\w+)`", whole):
        assert command in ("demo", "run", *EDGE, *RELAY)
    if argv == ("run",):
        such = re.search(r"such as (.+?) or (\S+); kinds:", whole)
        assert such is not None
        assert [split_spec(one)[0] for one in (*such[1].split(", "), such[2])] == ["demo", "csv", "mujoco"]
    if argv != ():
        assert whole.count(f"the first free one from {PAGE_PORT}") == 1
    else:
        assert "Start with `posecast demo`" in whole


@pytest.mark.parametrize(
    ("argv", "line"),
    [
        ((), "posecast: give a command: demo, run, edge, doctor, "),
        (("--versoin",), "posecast: unrecognized arguments: --versoin (did you mean --version?)"),
        (("dmeo",), "posecast: unknown command 'dmeo' (did you mean demo?): one of demo, run, "),
        (("demo", "--prot", "1"), "posecast demo: unrecognized arguments: --prot (did you mean --port?)"),
        (("demo", "--port", "70000"), "posecast demo: argument --port: use a number from 1 to 65535"),
        (("run",), "posecast run: the following arguments are required: --source"),
        (("run", "--source", "demo", "--robot", "A"), "posecast run: argument --robot: "),
        (("relay", "run"), "posecast relay: give --robots FILE"),
        (("edge", "run", "--source", "demo"), "posecast edge: the following arguments are required: --relay"),
        (("doctor",), "posecast: doctor: give --urdf"),
        (("past", "list", "--past", "x"), "posecast: --past 'x': "),
        (("convert", "x"), "posecast: the following arguments are required: OUT"),
        (("convert", "none", "x.csv"), "posecast: none: no such file or directory"),
    ],
)
def test_a_mistake_is_one_line_of_the_name_that_was_typed(argv: tuple[str, ...], line: str) -> None:
    ended = posecast(*argv)
    assert ended.stderr.startswith(line)
    assert (ended.stderr.count("\n"), ended.returncode, ended.stdout) == (1, 2, "")


@pytest.mark.parametrize("argv", [("completion", "bash"), ("--help",)])
@pytest.mark.parametrize(("stdout", "said"), [(None, ""), ("/dev/full", "No space left on device")])
def test_output_that_cannot_be_written_is_no_traceback(
    argv: tuple[str, ...], stdout: str | None, said: str
) -> None:
    """None: a pipe that nobody reads."""
    read, out = (os.open(stdout, os.O_WRONLY),) * 2 if stdout else os.pipe()
    if stdout is None:
        os.close(read)
    command = [sys.executable, "-m", "posecast_command", *argv]
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONUNBUFFERED"}
    ended = subprocess.run(
        command, stdout=out, stderr=subprocess.PIPE, env=environment, text=True, timeout=60, check=False
    )
    os.close(out)
    assert ended.returncode == 1
    assert ended.stderr == (f"posecast: stdout: {said}\n" if said else "")


def test_the_version_is_the_installed_one() -> None:
    assert posecast("--version").stdout == f"posecast {version('posecast')}\n"


def test_all_of_it_is_listed() -> None:
    text = make_parser().format_help()
    for name in ("demo", "run", *EDGE, *RELAY):
        assert f"\n    {name} " in text
    assert "exit status:" in text
