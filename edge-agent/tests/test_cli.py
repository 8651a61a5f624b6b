"""Wrong configuration: one line that says what and where, exit 2, no traceback."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from posecast_edge.settings import Settings, UsageError, parse_settings

GOOD = ["run", "--robot", "r1", "--source", "jsonl", "--relay", "tcp/127.0.0.1:7447"]


def test_flags_and_defaults() -> None:
    assert parse_settings(GOOD, {}) == Settings(
        "r1", "jsonl", "tcp/127.0.0.1:7447", 30.0, 4.0, profile=None, urdf=None, model=None
    )


def test_environment_stands_in_and_flags_win() -> None:
    environment = {
        "POSECAST_ROBOT": "r2",
        "POSECAST_SOURCE": "demo",
        "POSECAST_RELAY": "tls/relay.example:7447",
        "POSECAST_HZ": "10",
        "POSECAST_KEY_INTERVAL": "2.5",
        "POSECAST_PROFILE": "a.toml",
        "POSECAST_URDF": "b.urdf",
    }
    assert parse_settings(["run", "--hz", "20"], environment) == Settings(
        "r2", "demo", "tls/relay.example:7447", 20.0, 2.5, Path("a.toml"), Path("b.urdf"), None
    )


@pytest.mark.parametrize(
    ("argv", "environment", "part"),
    [
        ([], {}, "posecast-edge run"),
        (["run"], {}, "required: --robot, --source, --relay"),
        ([*GOOD, "--robot", "r*"], {}, "--robot: robot 'r*': use"),
        ([*GOOD, "--urdf", "a", "--model", "b"], {}, "--urdf and --model: give one"),
        ([*GOOD, "--robot", "../x"], {}, "--robot"),
        ([*GOOD, "--robot", ""], {}, "--robot"),
        ([*GOOD, "--source", "ros"], {}, "--source: unknown source 'ros': one of jsonl, trajectory, demo"),
        ([*GOOD, "--relay", "relay.example"], {}, "--relay: 'relay.example' is no endpoint like tcp/"),
        ([*GOOD, "--relay", "tcp/1.2.3.4:99999"], {}, "--relay"),
        ([*GOOD, "--relay", "tcp/a:1#bind=x"], {}, "--relay"),
        ([*GOOD, "--hz", "61"], {}, "--hz: '61' is no number from 1 to 60"),
        ([*GOOD, "--hz", "nan"], {}, "--hz"),
        ([*GOOD, "--key-interval", "0"], {}, "--key-interval"),
        ([*GOOD, "--speed", "1"], {}, "unrecognized arguments: --speed 1"),
        (GOOD, {"POSECAST_HZ": "fast"}, "--hz: 'fast' is no number"),
        (
            ["run"],
            {"POSECAST_ROBOT": "A", "POSECAST_SOURCE": "jsonl", "POSECAST_RELAY": "tcp/a:1"},
            "--robot",
        ),
    ],
)
def test_what_is_wrong_is_one_line(argv: list[str], environment: dict[str, str], part: str) -> None:
    with pytest.raises(UsageError) as caught:
        parse_settings(argv, environment)
    assert part in str(caught.value)
    assert "\n" not in str(caught.value)


def run(*argv: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "posecast_edge", *argv],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=20,
        check=False,
        env={},
    )


def test_help_lists_everything() -> None:
    done = run("run", "--help")
    assert done.returncode == 0
    for flag in ("--robot", "--source", "--relay", "--hz", "--key-interval", "--profile", "--urdf"):
        assert flag in done.stdout
        assert "POSECAST_" + flag[2:].upper().replace("-", "_") in done.stdout


def test_wrong_configuration_ends_with_2(tmp_path: Path) -> None:
    profile = tmp_path / "p.toml"
    profile.write_text('[labels]\njoint = ["A"]\n[[fields]]\nname = "pos"\nunit = "furlong"\n')
    urdf = tmp_path / "r.urdf"
    urdf.write_text("<robot")
    for argv, part in (
        (["--robot", "r*"], "robot 'r*'"),
        (["--profile", str(profile)], f"{profile}: fields.pos.unit: unknown unit 'furlong'"),
        (["--profile", str(tmp_path / "no.toml")], "no.toml: No such file"),
        (["--urdf", str(urdf)], f"{urdf}: line 1: "),
        (["--source", "jsonl:/nowhere"], "/nowhere: No such file"),
    ):
        done = run(*GOOD, *argv)
        assert done.returncode == 2, done.stderr
        assert done.stdout == ""
        assert done.stderr.count("\n") == 1, done.stderr
        assert done.stderr.startswith("posecast-edge: ")
        assert part in done.stderr
