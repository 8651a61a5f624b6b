"""Wrong configuration: one line that says what and where, exit 2, no traceback."""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from command_stage import run_edge
from posecast_edge.cli.settings import Settings, UsageError, parse_settings
from posecast_edge.uplink.credentials import Certificate
from posecast_edge.uplink.route import RelayRoute
from posecast_wire import Credential

GOOD = ["run", "--robot", "r1", "--source", "jsonl", "--relay", "tcp/127.0.0.1:7447"]


def test_flags_and_defaults() -> None:
    assert parse_settings(GOOD, {}) == Settings(
        "r1", "jsonl", RelayRoute("tcp/127.0.0.1:7447"), 30.0, 4.0, profile=None, urdf=None, model=None
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
        "r2", "demo", RelayRoute("tls/relay.example:7447"), 20.0, 2.5, Path("a.toml"), Path("b.urdf"), None
    )


@pytest.mark.parametrize(
    ("argv", "environment", "part"),
    [
        ([], {}, "posecast-edge run"),
        (["run"], {}, "required: --source, --relay"),
        ([*GOOD, "--robot", "r*"], {}, "--robot: robot 'r*': use"),
        ([*GOOD, "--urdf", "a", "--model", "b"], {}, "give --urdf or --model, not both"),
        ([*GOOD, "--robot", "../x"], {}, "--robot"),
        ([*GOOD, "--robot", ""], {}, "--robot"),
        (
            [*GOOD, "--source", "ros"],
            {},
            "--source: unknown source 'ros' (did you mean ros2?): one of jsonl, ",
        ),
        ([*GOOD, "--source", "jsnl"], {}, "--source: unknown source 'jsnl' (did you mean jsonl?): one of "),
        ([*GOOD, "--relay", "relay.example"], {}, "--relay: 'relay.example' is not an endpoint such as tcp/"),
        ([*GOOD, "--relay", "tcp/1.2.3.4:99999"], {}, "--relay"),
        ([*GOOD, "--relay", "tcp/a:1#bind=x"], {}, "--relay"),
        ([*GOOD, "--hz", "61"], {}, "--hz: '61' is not a number from 1 to 60"),
        ([*GOOD, "--hz", "nan"], {}, "--hz"),
        ([*GOOD, "--key-interval", "0"], {}, "--key-interval"),
        ([*GOOD, "--speed", "1"], {}, "unrecognized arguments: --speed 1"),
        (GOOD, {"POSECAST_HZ": "fast"}, "--hz: 'fast' is not a number from 1 to 60 [POSECAST_HZ]"),
        ([*GOOD, "--hz", "fast"], {"POSECAST_HZ": "5"}, "--hz: 'fast' is not a number from 1 to 60"),
        ([*GOOD, "--hz", "9" * 5000], {}, "--hz: '9999"),
        ([*GOOD, "--hz", "1e999"], {}, "--hz: '1e999' is not a number"),
        ([*GOOD, "--relay", "tcp/a:٧٤٤٧"], {}, "--relay"),
        ([*GOOD, "--relay", "tcp/a:1\u202e"], {}, "--relay: 'tcp/a:1\\u202e' is not an endpoint"),
        ([*GOOD, "--robot", "\udcff"], {}, "--robot"),
        ([*GOOD, "--credential", "x" * 5000], {}, "too long"),
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


def test_a_credential_as_editors_on_windows_write_it(tmp_path: Path) -> None:
    credential = Credential("r1", "s" * 43)
    file = tmp_path / "r1.credential"
    file.write_bytes(b"\xef\xbb\xbf" + credential.line().encode() + b"\r\n")
    file.chmod(0o600)
    assert parse_settings([*GOOD, "--credential", str(file)], {}).credential == credential


@pytest.mark.parametrize(
    "content",
    [b"", b"\0" * 100, b"\xff" * 100, b"posecast1:" * 10_000, b"posecast1:r1:" + b"s" * 43 + b":~"],
    ids=["empty", "zeros", "no text", "long", "no certificate"],
)
def test_no_credential_is_one_short_line(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "r1.credential"
    file.write_bytes(content)
    file.chmod(0o600)
    with pytest.raises(UsageError, match=r"--credential: .*: invalid credential: ") as caught:
        parse_settings([*GOOD, "--credential", str(file)], {})
    assert len(str(caught.value)) < 300


def test_help_lists_everything() -> None:
    done = run_edge("run", "--help", env={})
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
        (["--profile", str(profile)], f"{profile}:5: fields.pos.unit: unknown unit 'furlong'"),
        (["--profile", str(tmp_path / "no.toml")], "no.toml: No such file"),
        (["--profile", "x" * 5000], "File name too long"),
        (["--urdf", str(urdf)], f"{urdf}: line 1: "),
        (["--source", "jsonl:/nowhere"], "/nowhere: No such file"),
    ):
        done = run_edge(*GOOD, *argv, env={})
        assert done.returncode == 2, done.stderr
        assert done.stdout == ""
        assert done.stderr.count("\n") == 1, done.stderr
        assert done.stderr.startswith("posecast-edge: ")
        assert part in done.stderr


@pytest.mark.parametrize("command", [("probe", "demo"), ("doctor", "--source", "demo")])
@pytest.mark.parametrize("seconds", ["nan", "inf", "-1", "long"])
def test_a_source_is_watched_for_a_time_that_ends(command: tuple[str, ...], seconds: str) -> None:
    done = run_edge(*command, "--seconds", seconds)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.endswith(f"argument --seconds: '{seconds}' is not a number from 0 to 3600\n")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(("command", "missing"), [("model", "build"), ("profile", "new")])
def test_a_missing_word_is_named(command: str, missing: str) -> None:
    done = run_edge(command)
    assert done.returncode == 2
    assert done.stderr.endswith(f": the following arguments are required: {missing}\n")


STREAMS = {
    "doctor --urdf no.urdf >&-": 2,
    "probe demo --seconds 0.1 >/dev/full": 1,
    "probe demo --seconds 0.1 | head -c 1": 1,
    "probe jsonl <&-": 1,
    "run --robot a --source jsonl --relay tcp/127.0.0.1:1 <&-": 0,
    "run --robot a --source jsonl --relay tcp/127.0.0.1:1 2>&-": 0,
}


@pytest.mark.parametrize("arguments", STREAMS)
def test_a_stream_that_is_closed_or_full_is_no_traceback(arguments: str) -> None:
    script = f"set -o pipefail; {shlex.quote(sys.executable)} -m posecast_edge {arguments}"
    done = subprocess.run(
        ["bash", "-c", script],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )
    told = [
        line for line in done.stderr.splitlines() if not line.startswith("a | ")
    ]  # a slow machine's status
    assert len(told) <= 2, done.stderr  # what happened, and why there is no link
    assert "Traceback" not in done.stderr
    if "head" not in arguments:  # which may have read it all in time
        assert done.returncode == STREAMS[arguments]


def test_a_credential_names_the_robot(tmp_path: Path) -> None:
    credential = Credential("r1", "x" * 43)
    file = tmp_path / "r1.credential"
    file.write_text(credential.line() + "\n")
    file.chmod(0o600)
    argv = ["run", "--source", "jsonl", "--relay", "tls/relay.example:7447", "--credential", str(file)]
    for more in ([], ["--robot", "r1"]):
        settings = parse_settings([*argv, *more], {})
        assert (settings.robot, settings.credential) == ("r1", credential)

    def refused(*more: str) -> str:
        with pytest.raises(UsageError) as error:
            parse_settings([*argv, *more], {})
        said = str(error.value)
        assert credential.secret not in said
        assert "\n" not in said
        return said

    assert "--credential is for robot 'r1', but --robot is 'r2'" in refused("--robot", "r2")
    file.chmod(0o604)
    assert "chmod 600" in refused()
    file.chmod(0o600)
    file.write_text(credential.line()[:-1])
    assert "cut short or mistyped" in refused()
    file.unlink()
    assert "no such file or directory" in refused()
    with pytest.raises(UsageError, match="required: --robot, or a --credential that names it"):
        parse_settings(argv[:-2], {})


@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl here")
def test_a_certificate_instead(tmp_path: Path) -> None:
    new = "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2"
    for name in ("hubo", "other"):
        made = f"openssl {new} -subj /CN={name} -keyout {name}.key -out {name}.pem"
        subprocess.run(made.split(), cwd=tmp_path, check=True, capture_output=True)
    chain, key, other = tmp_path / "hubo.pem", tmp_path / "hubo.key", tmp_path / "other.key"
    relay = ["run", "--source", "demo", "--relay", "tls/relay.example:7447"]
    files = ["--tls-cert", str(chain), "--tls-key", str(key), "--tls-ca", str(chain)]
    found = parse_settings([*relay, "--robot", "hubo", *files], {})
    assert found.credential == Certificate(chain, key, chain)

    def refused(*argv: str) -> str:
        with pytest.raises(UsageError) as error:
            parse_settings([*relay, *argv], {})
        assert "\n" not in str(error.value)
        return str(error.value)

    named = ("--robot", "hubo")
    assert "required: --robot" in refused(*files)
    assert "--tls-key together" in refused(*named, *files[:2])
    assert "--tls-key together" in refused(*named, *files[4:])
    assert "use tls/… or quic/…" in refused(*named, *files, "--relay", "tcp/127.0.0.1:7447")
    assert "not a certificate and its key" in refused(*named, *files, "--tls-key", str(other))
    assert "no such file" in refused(*named, *files, "--tls-cert", str(tmp_path / "gone"))
    assert f"{key}: not a certificate" in refused(*named, *files, "--tls-ca", str(key))
    key.chmod(0o644)
    assert "chmod 600" in refused(*named, *files)
