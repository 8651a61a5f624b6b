"""The file of who may publish: what is wrong with it is one line that keeps its secrets."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from posecast_relay.config.robots_file import UnreadableError, read_robots
from posecast_relay.config.robots_reader import RobotsError
from posecast_relay.core.policy import Audience, Rule

SECRET = "C" * 43


def write(folder: Path, text: str, mode: int = 0o600) -> Path:
    """The file."""
    path = folder / "robots.toml"
    path.write_text(text)
    path.chmod(mode)
    return path


def test_who_may_publish_when(tmp_path: Path) -> None:
    text = f"""
        [robots.hubo]
        secret = "{SECRET}"
        [robots.g1]
        secret = "{SECRET}"
        expires = 1970-01-01T00:01:40Z
        [robots.later]
        """
    robots = read_robots(write(tmp_path, text))
    assert robots.find_secrets(99.0).keys() == {"hubo", "g1"}
    assert robots.find_secrets(100.0) == {"hubo": SECRET}
    assert SECRET not in repr(robots)


@pytest.fixture
def seoul(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A machine whose clock shows the time of Seoul."""
    monkeypatch.setenv("TZ", "KST-9")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


@pytest.mark.usefixtures("seoul")
@pytest.mark.parametrize("zone", ["", "Z", "+00:00"])
def test_a_time_without_a_zone_is_utc_on_every_machine(zone: str, tmp_path: Path) -> None:
    text = f'[robots.g1]\nsecret = "{SECRET}"\nexpires = 1970-01-02T00:00:00{zone}\n'
    robots = read_robots(write(tmp_path, text))
    assert robots.list_publishers(86_399.0) == ["g1"]
    assert robots.list_publishers(86_400.0) == []


def test_who_may_watch(tmp_path: Path) -> None:
    text = """
        [robots.hubo.anyone]
        frames = ["https://course.example", "http://10.0.0.5:8000"]
        [robots.hubo.signed-in]
        view = "lab"
        hz = 10
        delay_s = 0.5
        viewers = 0
        [robots.g1.anyone]
        past = "90s"
        [robots.g1.link]
        past = 0
        """
    policy = read_robots(write(tmp_path, text)).make_policy()
    assert policy.find_rules("hubo") == {
        Audience.ANYONE: Rule(frames=("https://course.example", "http://10.0.0.5:8000")),
        Audience.SIGNED_IN: Rule("lab", 10.0, 0.5, 0),
    }
    assert policy.find_rules("g1") == {Audience.ANYONE: Rule(past_s=90.0), Audience.LINK: Rule(past_s=0.0)}
    assert policy.find_rules("h1") == {}


def test_a_file_with_a_comment_alone_lets_nobody_in(tmp_path: Path) -> None:
    assert read_robots(write(tmp_path, "# nobody\n")).find_secrets(0.0) == {}


def test_what_is_no_file_is_refused_and_never_waited_for(tmp_path: Path) -> None:
    path = tmp_path / "robots.toml"
    makers: dict[str, Callable[[], object]] = {
        "is a folder": path.mkdir,
        "is not a file": lambda: os.mkfifo(path, 0o600),
        "too many levels of symbolic links": lambda: path.symlink_to(path),
    }
    for says, make in makers.items():
        make()
        with pytest.raises(UnreadableError, match=says):
            read_robots(path)
        path.rmdir() if path.is_dir() else path.unlink()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[robots.hubo]\nsecrte = 'CANARY'", "[robots.hubo]: unknown field 'secrte': use secret, expires"),
        ("[robots.hubo.anyone]\nhertz = 3", "[robots.hubo.anyone]: unknown field 'hertz': use view, hz"),
        (
            "[robots.hubo.everyone]",
            "[robots.hubo]: unknown field 'everyone': use secret, expires, link_key, keep, anyone",
        ),
        ("[robots.hubo]\nanyone = 'CANARY'", "[robots.hubo.anyone]: want a table"),
        ("[robots.hubo.anyone]\nview = '*'", "[robots.hubo.anyone] view '*': use"),
        ("[robots.hubo.anyone]\nhz = 0", "[robots.hubo.anyone] hz: want a number from 0.1 to 60"),
        ("[robots.hubo.anyone]\ndelay_s = 61", "[robots.hubo.anyone] delay_s: want a number from 0 to 60"),
        ("[robots.hubo.link]\nviewers = 1.5", "[robots.hubo.link] viewers: want a whole number"),
        ("[robots.hubo.link]\nblackout = 1", "[robots.hubo.link] blackout: want true or false"),
        ("[robots.r.anyone]\nframes='*'", "[robots.r.anyone] frames: want a list of at most 100 origins"),
        ("[robots.r.anyone]\nframes=['https://a.example/']", "frames: number 1 is not an origin"),
        ("[robots.r.anyone]\nframes=['https://a', 'https://a; script-src *']", "frames: number 2 is no"),
        ("[robots.r.link]\nframes=[]", "[robots.r.link] frames: only in `anyone`"),
        ("[robots.r.anyone]\ndelay_s=1\n[robots.r.link]\ndelay_s=2", "[robots.r]: two delays for view"),
        ('[robots.r]\nkeep = "30"', '[robots.r] keep: want a time like "90s", "30m", "12h" or "30d"'),
        ("[robots.r.anyone]\npast = 30", '[robots.r.anyone] past: want a time like "90s", "30m"'),
        ("[robots.r.anyone]\npast = true", "[robots.r.anyone] past: want a time"),
        ("[robots.r.anyone]\npast = '-1s'", "[robots.r.anyone] past: want a time"),
        ("[robots.r.anyone]\npast = '1e9d'", "[robots.r.anyone] past: want a time"),
        ("[robots.r.anyone]\npast = '3661d'", "[robots.r.anyone] past: want a time"),
        (
            "[robots.r.anyone]\npast = '30m'\nhz = 10",
            "[robots.r.anyone] past: not together with `hz`, because the past has every frame",
        ),
        ("[robots.r]\nkeep = 'CANARY'", "[robots.r] keep: want a time"),
        (
            "[robots.r]\nkeep='1h'\n[robots.r.link]\npast='61m'",
            "[robots.r.link] past: longer than `keep`, '1h'",
        ),
        ("[robots.r]\nkeep = 0", "[robots.r] keep: to keep nothing, leave it out"),
        ("[robot.hubo]", "the file: unknown field 'robot': use robots"),
        ("[robots.'*']", "robot '*': use 1 to 63"),
        ("robots = 3", "robots: want tables"),
        ("[robots]\nhubo = 'CANARY'", "[robots.hubo]: want a table"),
        ("[robots.hubo]\nsecret = 'CANARY'", "[robots.hubo] secret: use a secret that"),
        ("[robots.hubo]\nsecret = 'CANARY:x\\ny'", "[robots.hubo] secret: use a secret that"),
        ("[robots.hubo]\nexpires = 2030", "[robots.hubo] expires: want a time"),
        ("[robots.hubo\nsecret = 'CANARY'", "line 1"),
        (" \n", "is empty; if you want no robots, leave a comment in it"),
        ('[robots.hubo]\n"a\\nb" = 1', "unknown field 'a?b'"),
    ],
)
def test_a_wrong_file_is_one_line(tmp_path: Path, text: str, says: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(RobotsError) as error:
        read_robots(path)
    said = str(error.value)
    assert said.startswith(f"{path}: ")
    assert says in said
    assert "CANARY" not in said
    assert "\n" not in said


def test_a_file_that_everybody_may_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotsError, match="chmod 600"):
        read_robots(write(tmp_path, "", 0o644))
    with pytest.raises(RobotsError, match="no such file"):
        read_robots(tmp_path / "none.toml")
    with pytest.raises(RobotsError, match="over 4000000 bytes"):
        read_robots(write(tmp_path, "#" * 4_000_001))
    path = write(tmp_path, "")
    path.write_bytes(b"\xff")
    with pytest.raises(RobotsError, match="not UTF-8"):
        read_robots(path)


def test_how_long_robots_are_kept(tmp_path: Path) -> None:
    path = write(tmp_path, "[robots.r]\nkeep = '30d'\n[robots.r.link]\npast = '30d'\n[robots.s]\n")
    robots = read_robots(path)
    assert robots.make_policy().keeps_s == {"r": 30 * 86400.0}
    with pytest.raises(RobotsError, match=r"\[robots.r\] keep: needs an object store"):
        read_robots(path, has_store=False)
