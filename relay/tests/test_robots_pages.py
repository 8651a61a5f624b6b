"""The commands of the pages on robots, access and the archive do what the pages say, one after the other."""

from __future__ import annotations

import os
import pty
import subprocess
import sys
from datetime import timedelta
from pathlib import Path

import pytest
from posecast_relay.config.robots_file import read_robots
from posecast_relay.config.robots_reader import Robots
from posecast_relay.core.policy import Audience, Rule

from .certificates import certificates
from .operator_pages import DOCS, list_commands

BIN = Path(sys.executable).parent
PLACES = "runuser -u posecast-relay -- env", "/var/lib/posecast-relay", "/opt/posecast/bin"


def run(script: str, folder: Path, *, stdin: int = subprocess.DEVNULL) -> str:
    """Run lines of a page in a folder that has what they need; what they print."""
    environ = os.environ | {
        "PATH": f"{BIN}:{os.environ['PATH']}",
        "EDITOR": "true",
        "POSECAST_ROBOTS": str(folder / "robots.toml"),
    }
    environ.pop("VISUAL", None)
    done = subprocess.run(
        ["bash", "-euc", f"shopt -s expand_aliases\n{script}"],
        cwd=folder,
        stdin=stdin,
        env=environ,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 0, f"{script}\n{done.stderr}"
    return done.stdout


def pick(page: str, *starts: str) -> list[str]:
    """The commands of a page that begin like one of these."""
    return [line for line in list_commands(page) if line.startswith(starts)]


def read(folder: Path) -> Robots:
    return read_robots(folder / "robots.toml")


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    """A folder with the relay's authority and a robot."""
    certificates(tmp_path)
    run("posecast-relay robots add hubo", tmp_path)
    return tmp_path


def test_a_robot_is_added_rotated_and_removed(lab: Path) -> None:
    run("posecast-relay robots remove hubo", lab)
    page = "how-to/operate/add-robots.md"
    add, begin, lay, finish, leaked, show, remove = pick(page, "(umask", "posecast-relay robots", "chmod")
    run(add, lab)
    assert (lab / "hubo.credential").stat().st_mode & 0o777 == 0o600
    first = read(lab).enrolled["hubo"].secret
    run(begin, lab)
    assert read(lab).enrolled["hubo"].secret == first, "the next one does not work yet"
    run(f"{lay}\n{finish}", lab)
    second = read(lab).enrolled["hubo"].secret
    assert second not in (None, first)
    assert str(second) in (lab / "hubo.credential").read_text()
    run(leaked, lab)
    assert read(lab).enrolled["hubo"].secret not in (None, first, second)
    assert "hubo" in run(show, lab)
    run(remove, lab)
    assert read(lab).enrolled == {}


def test_each_audience_gets_what_the_page_says(lab: Path) -> None:
    commands = pick("how-to/operate/decide-who-watches.md", "posecast-relay robots")
    delay, show, hide, link, make, end, account, back, dark, light, frames = commands
    run(delay, lab)
    assert read(lab).enrolled["hubo"].rules == {Audience.ANYONE: Rule(delay_s=10.0, viewers=500)}
    assert "public (10 s late, 500 at a time, no past)" in run(show, lab)
    run(hide, lab)
    assert read(lab).enrolled["hubo"].rules == {}
    run(link, lab)
    assert run(make, lab).startswith("https://relay.example/#/r/hubo?t=")
    key = read(lab).enrolled["hubo"].link_key
    run(end, lab)
    assert read(lab).enrolled["hubo"].link_key != key
    run(f"{account}\n{back}", lab)
    past = {audience: rule.past_s for audience, rule in read(lab).enrolled["hubo"].rules.items()}
    hour = timedelta(hours=1).total_seconds()
    assert past == {Audience.ANYONE: hour / 2, Audience.LINK: 48 * hour, Audience.SIGNED_IN: 48 * hour}
    run(dark, lab)
    assert read(lab).enrolled["hubo"].rules[Audience.ANYONE].blackout
    run(light, lab)
    assert not read(lab).enrolled["hubo"].rules[Audience.ANYONE].blackout
    run(frames, lab)
    assert read(lab).enrolled["hubo"].rules[Audience.ANYONE].frames == (
        "https://course.example",
        "https://lab.example",
    )


def test_the_admin_page_is_opened_to_a_network(lab: Path) -> None:
    first, network = pick("how-to/operate/admin-page.md", "posecast-relay robots")
    printed = run(first, lab)
    admin = read(lab).admin
    assert admin is not None
    assert admin.secret in printed
    assert admin.networks == ()
    run(network, lab)
    admin = read(lab).admin
    assert admin is not None
    assert [str(each) for each in admin.networks] == ["10.1.0.0/16"]


def test_the_archive_is_set_up_and_given_up(lab: Path) -> None:
    alias, *commands = pick("how-to/operate/keep-months.md", "alias", "relay ")
    assert all(place in alias for place in PLACES)
    for place, here in zip(PLACES, ("env", str(lab), str(BIN)), strict=True):
        alias = alias.replace(place, here)
    (lab / "past").mkdir()
    alias = alias.replace("/srv/posecast/past", str(lab / "past"))
    keep, show, kept, link, kept_by_day, stop = commands
    run(f"{alias}\n{keep}\n{show}\n{kept}\n{link}\n{kept_by_day}", lab)
    robot = read(lab).enrolled["hubo"]
    day = timedelta(days=1).total_seconds()
    assert robot.keep_s == 30 * day
    assert {audience: rule.past_s for audience, rule in robot.rules.items()} == {
        Audience.ANYONE: 2 * day,
        Audience.LINK: 30 * day,
    }
    run("posecast-relay robots set hubo --anyone past=30m --link past=2d", lab)
    run(f"{alias}\n{stop}", lab)
    assert read(lab).enrolled["hubo"].keep_s is None


def test_a_past_is_hidden(lab: Path) -> None:
    (hide,) = pick("how-to/operate/delete-the-past.md", "posecast-relay robots")
    run(hide, lab)
    assert read(lab).enrolled["hubo"].rules[Audience.ANYONE].past_s == 0


def test_the_commands_of_the_reference_change_and_check_the_file(lab: Path) -> None:
    commands = pick("reference/robots-file.md", "posecast-relay")
    assert [command.split()[2] for command in commands] == ["set", "edit", "check"]
    at, terminal = pty.openpty()
    try:
        for command in commands:
            run(command, lab, stdin=terminal)
    finally:
        os.close(at)
        os.close(terminal)
    assert read(lab).enrolled["hubo"].rules == {
        Audience.ANYONE: Rule(delay_s=10.0),
        Audience.LINK: Rule(past_s=7200.0),
    }


def test_the_example_of_the_reference_is_a_good_file(tmp_path: Path) -> None:
    page = (DOCS / "reference/robots-file.md").read_text(encoding="utf-8")
    example = page.partition("```toml\n")[2].partition("```")[0]
    (tmp_path / "robots.toml").touch(0o600)
    (tmp_path / "robots.toml").write_text(example.replace('"…"', f'"{"C" * 43}"'))
    rules = read_robots(tmp_path / "robots.toml").enrolled["hubo"].rules
    assert set(rules) == {Audience.ANYONE, Audience.LINK}
