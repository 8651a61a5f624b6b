"""What `posecast run` decides before it starts anything."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from posecast_command.run import name_robot, run_robot

BIN = Path(sys.executable).parent


@pytest.mark.parametrize(
    ("model", "name"),
    [
        (None, "robot"),
        ("arm.urdf", "arm"),
        ("models/My Arm v2.urdf.xacro", "my-arm-v2"),
        ("팔.urdf", "robot"),
        (f"{'a' * 200}.urdf", "robot"),
    ],
)
def test_a_robot_without_a_name_has_its_models(model: str | None, name: str) -> None:
    assert name_robot(None if model is None else Path(model)) == name


@pytest.mark.parametrize("place", [["--port", "8080"], ["--host", "0.0.0.0"], ["--no-browser"]])
@pytest.mark.parametrize(
    ("flags", "named"),
    [
        (["--relay", "tcp/127.0.0.1:1"], "--relay"),
        (["--tls-cert", "a.pem"], "--tls-cert"),
    ],
)
def test_flags_of_a_relay_here_do_not_go_with_one_elsewhere(
    flags: list[str], named: str, place: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_robot(["--source", "demo", *flags, *place], {}) == 2
    printed = capsys.readouterr().err
    assert printed.startswith("posecast run: --host, --port and --no-browser are for a relay started here")
    assert printed.endswith(f"{named} is for a relay elsewhere; give one kind\n")


def test_a_robot_at_a_relay_elsewhere_needs_a_name() -> None:
    command = [
        f"{BIN}/posecast",
        "run",
        "--source",
        "demo",
        "--urdf",
        "arm.urdf",
        "--relay",
        "tcp/127.0.0.1:1",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=30)
    assert (done.returncode, done.stdout) == (2, "")
    assert "required: --robot, or a --credential that names it" in done.stderr


def test_what_the_agent_will_refuse_is_refused_first(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_robot(["--source", "demo", "--urdf", "a", "--model", "b"], {}) == 2
    assert capsys.readouterr().err == "posecast run: give --urdf or --model, not both\n"
