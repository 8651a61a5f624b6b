"""The file of who may publish: what is wrong with it is one line that keeps its secrets."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from posecast_relay.config.robots_file import UnreadableError, lock_folder, read_robots, replace_text
from posecast_relay.config.robots_reader import RobotsError
from posecast_relay.config.settings import SettingsError
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


# ---- whose the file of robots is after it was written: the relay has to be able to read it ----


RELAY, OTHER = 10001, 10002
ROOT = pytest.mark.skipif(os.geteuid() != 0, reason="only root can make files of other users")


# that user may not be able to read our Python: all is loaded before
PROGRAM = """
import os, sys
import posecast_relay.config.robots_command
from posecast_relay.cli import main
"".encode("utf-8-sig"), b"".decode("utf-8-sig"), "".encode("ascii"), b"".decode("ascii")
user = int(sys.argv.pop(1))
os.setgroups([]), os.setgid(user), os.setuid(user)
main()
"""


def robots(path: Path, *words: str, user: int, stdin: str = "") -> subprocess.CompletedProcess[str]:
    """`posecast-relay robots` as another user."""
    command = [sys.executable, "-c", PROGRAM, str(user), "robots", *words, "--robots", str(path)]
    return subprocess.run(command, input=stdin, capture_output=True, text=True, timeout=20, check=False)


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    """A folder of the relay's user, as a volume in compose is, that others can enter."""
    for folder in (tmp_path, *tmp_path.parents[:3]):  # of pytest, and of its processes
        folder.chmod(0o755)
    lab = tmp_path / "robots"
    lab.mkdir()
    os.chown(lab, RELAY, RELAY)
    return lab


def owner(path: Path) -> tuple[int, int, int]:
    """User, group and mode."""
    found = path.stat()
    return found.st_uid, found.st_gid, stat.S_IMODE(found.st_mode)


@ROOT
def test_root_leaves_it_to_whom_it_belongs(lab: Path) -> None:
    path = lab / "robots.toml"
    assert robots(path, "add", "hubo", user=0).returncode == 0
    assert owner(path) == (RELAY, RELAY, 0o600), "a new file is its folder's owner's"
    os.chown(path, OTHER, RELAY)
    path.chmod(0o640)
    assert robots(path, "set", "hubo", "--anyone", "delay_s=10", user=0).returncode == 0
    assert owner(path) == owner(lab / "robots.toml.bak") == (OTHER, RELAY, 0o640)


@ROOT
def test_who_would_take_it_from_the_relay_is_refused(lab: Path) -> None:
    path = lab / "robots.toml"
    robots(path, "add", "hubo", user=RELAY)
    path.chmod(0o660)
    os.chown(path, RELAY, OTHER)
    lab.chmod(0o777)
    before = path.read_text()
    done = robots(path, "remove", "hubo", user=OTHER)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert f"belongs to uid {RELAY}, and would belong to uid {OTHER} afterwards" in done.stderr
    done = robots(path, "remove", "hubo", user=RELAY)  # who can't give it its group again
    assert done.returncode == 2
    assert f"its group {OTHER} can't stay" in done.stderr
    assert path.read_text() == before
    assert [each.name for each in lab.iterdir()] == ["robots.toml"]


@ROOT
def test_a_file_that_root_has_put_there_is_replaced_by_the_relays_own_user(lab: Path) -> None:
    """As `docker compose cp` does: root's, and for root alone."""
    path = lab / "robots.toml"
    path.write_text("[robots.hubo]\n")
    path.chmod(0o600)
    done = robots(path, "check", user=RELAY)
    assert done.returncode == 1
    assert (
        f"permission denied: it belongs to root (uid 0), mode 0600, and this process runs as uid {RELAY}"
        in done.stdout
    )
    done = robots(path, "edit", user=RELAY, stdin="[robots.g1]\n")
    assert (done.returncode, done.stderr.count("\n")) == (2, 2)
    assert robots(path, "edit", "--yes", user=RELAY, stdin="[robots.g1]\n").returncode == 0
    assert owner(path) == (RELAY, RELAY, 0o600)
    assert path.read_text() == "[robots.g1]\n"


def test_a_link_to_the_file_stays_one(tmp_path: Path) -> None:
    real, link = tmp_path / "real.toml", tmp_path / "robots.toml"
    link.symlink_to(real)
    replace_text(link, "[robots.hubo]\n")
    assert link.is_symlink()
    assert "[robots.hubo" in real.read_text()


def test_nobody_waits_forever_for_who_holds_the_lock(tmp_path: Path) -> None:
    lab, elsewhere = tmp_path / "lab", tmp_path / "elsewhere"
    lab.mkdir()
    elsewhere.mkdir()
    real, link = lab / "robots.toml", elsewhere / "robots.toml"
    link.symlink_to(real)
    with lock_folder(link):
        says = f"{real}: another command has been changing it for over 0 s"
        with pytest.raises(SettingsError, match=says), lock_folder(real, wait_s=0.0):
            pass
    with lock_folder(real, wait_s=0.0):
        pass


def test_what_a_killed_command_left_goes_with_the_next_one(tmp_path: Path) -> None:
    path, other = tmp_path / "robots.toml", tmp_path / "other"
    other.write_text("another file")
    left = tmp_path / ".robots.toml.new"
    leavers: tuple[Callable[[], object], ...] = (
        lambda: left.write_text("half"),
        lambda: left.symlink_to(other),
    )
    for leave in leavers:
        leave()
        replace_text(path, "[robots.hubo]\n")
        assert path.read_text() == "[robots.hubo]\n"
        assert sorted(each.name for each in tmp_path.iterdir()) == ["other", "robots.toml"]
    assert other.read_text() == "another file"


def test_a_link_put_in_the_way_changes_no_other_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder's user may be quicker than root, who works for them."""
    path, other = tmp_path / "robots.toml", tmp_path / "other"
    other.write_text("another file")
    other.chmod(0o644)
    open_file = os.open

    def open_and_swap(name: str | Path, *words: int, **named: int) -> int:
        handle = open_file(name, *words, **named)
        if Path(name).name.startswith(".robots.toml"):
            Path(name).unlink()
            Path(name).symlink_to(other)
        return handle

    monkeypatch.setattr(os, "open", open_and_swap)
    replace_text(path, "[robots.hubo]\n")
    assert (other.read_text(), stat.S_IMODE(other.stat().st_mode)) == ("another file", 0o644)


def test_a_pipe_in_its_place_is_replaced_and_not_read(tmp_path: Path) -> None:
    path = tmp_path / "robots.toml"
    os.mkfifo(path, 0o600)
    replace_text(path, "[robots.hubo]\n", keep_before=True)
    assert path.read_text() == "[robots.hubo]\n"
    assert [each.name for each in tmp_path.iterdir()] == ["robots.toml"]
