"""Whose the file of robots is after it was written: the relay has to be able to read it."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from posecast_relay.config.robots_file import lock_folder, replace_text
from posecast_relay.config.settings import SettingsError

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
