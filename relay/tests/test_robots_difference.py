"""What `robots edit` says of credentials: an older copy of the file brings none back unasked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from posecast_relay.config.robots_command import list_credential_changes
from posecast_relay.config.robots_reader import parse_robots

from .test_robots_command import robots
from .test_robots_edit import Terminal, run

OLDER = "possibly an older one; the previous one stops working"
KINDS = {
    "add": ([["add", "lab3"]], ["lab3: removed: its credential and its share links stop working"]),
    "remove": ([["remove", "g1"]], ["g1: added, or restored after its removal: it can publish"]),
    "rotate": ([["rotate", "hubo"]], [f"hubo: gets a different credential, {OLDER}"]),
    "rotate in two steps": (
        [["rotate", "hubo", "--begin"], ["rotate", "hubo", "--finish"]],
        [f"hubo: gets a different credential, {OLDER}"],
    ),
    "rotate, begun": (
        [["rotate", "hubo", "--begin"]],
        ["hubo: loses its next credential (`rotate --begin`)"],
    ),
    "admin": ([["admin"]], [f"/admin: gets a different credential, {OLDER}"]),
    "unlink": ([["unlink", "hubo"]], [f"hubo: gets a different key of its share links, {OLDER}"]),
    "a credential that ends": (
        [["add", "g1", "--certificate", "--days", "3"]],
        ["g1: can publish for longer (`expires`)"],
    ),
    "several": (
        [["rotate", "hubo"], ["add", "lab3"], ["admin"]],
        [
            f"hubo: gets a different credential, {OLDER}",
            "lab3: removed: its credential and its share links stop working",
            f"/admin: gets a different credential, {OLDER}",
        ],
    ),
}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file with a robot of each kind, share links and the page /admin."""
    path = tmp_path / "robots.toml"
    for words in (
        ["add", "hubo"],
        ["set", "hubo", "--link", "view=public"],
        ["link", "hubo"],
        ["add", "g1", "--certificate"],
        ["admin"],
    ):
        assert robots(path, *words).returncode == 0
    return path


@pytest.mark.parametrize(("commands", "lines"), KINDS.values(), ids=KINDS)
def test_an_older_copy_brings_back_no_credential_unasked(
    path: Path, commands: Sequence[Sequence[str]], lines: Sequence[str]
) -> None:
    copy = path.read_text()
    for words in commands:
        assert robots(path, *words).returncode == 0
    now = path.read_text()

    done = run(path, "edit", copy.encode())
    assert done.returncode == 2
    said = done.stderr.splitlines()
    assert said[:-1] == [f"stdin: {line}" for line in lines]
    assert said[-1] == (
        f"posecast-relay: {path}: nothing was changed; to write this text anyway, use `robots edit --yes`"
    )
    assert path.read_text() == now

    done = run(path, "edit", copy.encode(), "--yes")
    assert (done.returncode, done.stderr.splitlines()) == (0, [f"stdin: {line}" for line in lines])
    assert path.read_text() == copy


def test_what_the_version_before_brings_back_is_said(path: Path) -> None:
    robots(path, "set", "hubo", "--anyone", "delay_s=10")
    robots(path, "rotate", "hubo")
    done = run(path, "edit", Path(f"{path}.bak").read_bytes())
    assert (done.returncode, done.stderr.count("\n")) == (2, 2)
    assert f"stdin: hubo: gets a different credential, {OLDER}\n" in done.stderr


def test_other_changes_are_written_unasked(path: Path) -> None:
    text = path.read_text().replace('view = "public"', 'view = "public"\ndelay_s = 3', 1) + "# by the door\n"
    done = run(path, "edit", text.encode())
    assert (done.returncode, done.stderr) == (0, "")
    assert path.read_text() == text


@pytest.mark.parametrize("spoil", [lambda path: path.write_text("x ="), lambda path: path.chmod(0o604)])
def test_a_file_that_cannot_be_compared_is_replaced_only_when_asked(
    path: Path, spoil: Callable[[Path], object]
) -> None:
    copy = path.read_bytes()
    spoil(path)
    done = run(path, "edit", copy)
    assert (done.returncode, done.stderr.count("\n")) == (2, 2)
    assert done.stderr.startswith(
        f"stdin: can't compare credentials, because the present file is invalid: {path}: "
    )
    assert run(path, "edit", copy, "--yes").returncode == 0
    assert path.read_bytes() == copy


def test_a_file_that_is_not_there_is_written(path: Path) -> None:
    copy = path.read_bytes()
    path.unlink()
    assert run(path, "edit", copy).returncode == 0
    assert path.read_bytes() == copy


def test_after_an_editor_it_is_said_too(path: Path, tmp_path: Path) -> None:
    own = tmp_path / "own"
    own.mkdir()
    copy = path.read_text()
    robots(path, "rotate", "hubo")
    status, said = Terminal(path, own, copy).end()
    assert (status, said) == (0, f"{path}: hubo: gets a different credential, {OLDER}\n")
    assert path.read_text() == copy


def test_no_secret_is_said(path: Path) -> None:
    before, after = parse_robots(path.read_text()), parse_robots("[robots.hubo]\n")
    lines = "\n".join(list_credential_changes(before, after))
    hubo, admin = before.enrolled["hubo"], before.admin
    assert admin is not None
    for secret in (hubo.secret, hubo.link_key, admin.secret):
        assert secret is not None
        assert secret not in lines
    assert lines.count("loses its") == 3
