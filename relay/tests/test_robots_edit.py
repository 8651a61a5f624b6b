"""`robots check` and `robots edit`: what is wrong is said whole, and never written."""

from __future__ import annotations

import os
import pty
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from posecast_relay.config.robots_reader import MISTAKES_MAX, RobotsError, parse_robots
from posecast_testing import until

from .command import run_command

WRONG = """# the lab's
[robots.hubo]
secrte = 1

[robots.hubo.anyone]
view = "public"
hz = 0            # too few
delay_s = "soon"
[robots.g1]
anyone = { view = "*" }
[robots.'*']
"""
MISTAKES = [
    "[robots.hubo]: unknown field 'secrte': use secret, expires, link_key, keep, anyone, signed-in, link, "
    "next_secret (at line 3)",
    "[robots.hubo.anyone] hz: want a number from 0.1 to 60 (at line 7)",
    "[robots.hubo.anyone] delay_s: want a number from 0 to 60 (at line 8)",
    "[robots.g1.anyone] view '*'",
    "robot '*'",
]


def run(
    path: Path, do: str, stdin: bytes | None = None, *flags: str, **environ: str
) -> subprocess.CompletedProcess[str]:
    """`posecast-relay robots …` with its stdin from a file."""
    return run_command("robots", do, *flags, "--robots", str(path), stdin=stdin or b"", **environ)


def write(folder: Path, text: str) -> Path:
    """The file."""
    path = folder / "robots.toml"
    path.write_text(text)
    path.chmod(0o640)
    return path


def test_all_that_is_wrong_is_said_at_once_with_lines(tmp_path: Path) -> None:
    path = write(tmp_path, WRONG)
    done = run(path, "check")
    assert (done.returncode, done.stderr) == (1, "")
    said = done.stdout.splitlines()
    assert len(said) == len(MISTAKES)
    for line, mistake in zip(said, MISTAKES, strict=True):
        assert line.startswith(f"{path}: {mistake}")
    assert said[3].endswith("(at line 10)")
    assert said[4].endswith("(at line 11)")
    done = run(path, "list")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "and 4 more: `robots check` lists all" in done.stderr


def test_a_good_file_and_one_that_is_not_there(tmp_path: Path) -> None:
    path = write(tmp_path, "[robots.hubo]\nkeep = '30d'\n")
    done = run(path, "check")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", f"{path}: no errors\n")
    done = run(path, "check", POSECAST_PAST="memory:")  # as in the relay's container
    assert done.returncode == 1
    assert "[robots.hubo] keep: needs an object store" in done.stdout
    done = run(tmp_path / "none.toml", "check")
    assert (done.returncode, done.stdout) == (1, f"{tmp_path}/none.toml: no such file or directory\n")
    done = run(tmp_path, "check")
    assert (done.returncode, done.stdout) == (1, f"{tmp_path}: is a folder\n")


def test_mistakes_are_bounded() -> None:
    text = "".join(f"[robots.r{n}]\nx = 1\n" for n in range(2 * MISTAKES_MAX))
    with pytest.raises(RobotsError) as error:
        parse_robots(text)
    assert len(error.value.mistakes) == MISTAKES_MAX


def test_a_text_from_stdin_is_written_if_it_is_good(tmp_path: Path) -> None:
    path = write(tmp_path, "[robots.hubo]\n")
    done = run(path, "edit", WRONG.encode())
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == len(MISTAKES) + 1
    assert "stdin: [robots.hubo.anyone] hz: want a number from 0.1 to 60 (at line 7)\n" in done.stderr
    for stdin, says in (
        (b" \n", "stdin: is empty; if you want no robots, leave a comment in it\n"),
        (b"\xff", "not UTF-8"),
        (b"#" * 4_000_001, "over 40000"),
    ):
        done = run(path, "edit", stdin)
        assert done.returncode == 2
        assert says in done.stderr
    assert path.read_text() == "[robots.hubo]\n"
    assert [each.name for each in tmp_path.iterdir()] == ["robots.toml"]

    assert run(path, "edit", b"[robots.g1]\n", "--yes").returncode == 0
    assert path.read_text() == "[robots.g1]\n"
    backup = tmp_path / "robots.toml.bak"
    assert backup.read_text() == "[robots.hubo]\n"
    assert [stat.S_IMODE(each.stat().st_mode) for each in (path, backup)] == [0o640, 0o640]


class Terminal:
    """`robots edit` on a terminal, with an editor that writes one text after another."""

    def __init__(self, path: Path, folder: Path, *texts: str) -> None:
        for n, text in enumerate(texts):
            (folder / f"text-{n}").write_text(text)
        editor = folder / "editor"
        editor.write_text(
            f"#!/bin/sh\nn=$(cat {folder}/turn 2>/dev/null || echo 0)\n"
            f"stat -c %a $(dirname $1) >> {folder}/modes\n"
            f"echo $1 >> {folder}/seen\n"
            f"cp {folder}/text-$n $1\n"
            f"echo $((n + 1)) > {folder}/turn\n"
        )
        editor.chmod(0o700)
        self._at, terminal = pty.openpty()
        command = [sys.executable, "-m", "posecast_relay.cli", "robots", "edit", "--robots", str(path)]
        self.process = subprocess.Popen(
            command,
            stdin=terminal,
            stdout=terminal,
            stderr=subprocess.PIPE,
            env=os.environ | {"VISUAL": str(editor)},
        )
        os.close(terminal)

    def answer(self, text: str) -> None:
        os.write(self._at, text.encode())

    def end(self) -> tuple[int, str]:
        """Its status and its stderr."""
        said = self.process.communicate(timeout=20)[1].decode()
        os.close(self._at)
        return self.process.returncode, said


def test_an_editor_is_opened_again_until_the_file_is_right(tmp_path: Path) -> None:
    lab, own = tmp_path / "lab", tmp_path / "own"
    lab.mkdir()
    own.mkdir()
    path = write(lab, "[robots.hubo]\n")
    edit = Terminal(path, own, WRONG, "", "[robots.g1]\n")
    edit.answer("\n\n")
    status, said = edit.end()
    assert status == 0, said
    assert "robots.toml: is empty; if you want no robots, leave a comment in it\n" in said
    assert "robots.toml: [robots.hubo.anyone] hz: want a number from 0.1 to 60 (at line 7)\n" in said
    assert said.endswith(
        f"{path}: g1: added, or restored after its removal: it can publish\n"
        f"{path}: hubo: removed: its credential and its share links stop working\n"
    )
    assert path.read_text() == "[robots.g1]\n"
    assert (lab / "robots.toml.bak").read_text() == "[robots.hubo]\n"
    assert set((own / "modes").read_text().split()) == {"700"}
    for copy in (own / "seen").read_text().split():
        assert not Path(copy).exists(), "it holds secrets"


def test_who_gives_up_changes_nothing(tmp_path: Path) -> None:
    lab, own = tmp_path / "lab", tmp_path / "own"
    lab.mkdir()
    own.mkdir()
    path = write(lab, "[robots.hubo]\n")
    edit = Terminal(path, own, WRONG)
    edit.answer("q\n")
    status, said = edit.end()
    assert status == 2
    assert said.endswith(f"{path}: nothing was changed\n")
    assert path.read_text() == "[robots.hubo]\n"
    (own / "turn").unlink()
    edit = Terminal(path, own, "[robots.hubo]\n")
    assert edit.end() == (0, f"{path}: unchanged\n")
    assert [each.name for each in lab.iterdir()] == ["robots.toml"]


@pytest.mark.parametrize("theirs", ["[robots.theirs]\n", None])
def test_what_two_people_write_at_once_is_not_lost(tmp_path: Path, theirs: str | None) -> None:
    path = write(tmp_path, "[robots.hubo]\n")
    at, terminal = pty.openpty()
    mark = tmp_path / "editing"
    editor = tmp_path / "editor"
    editor.write_text(
        f"#!/bin/sh\ntouch {mark}\nwhile [ -e {mark} ]; do sleep 0.02; done\necho '[robots.mine]' > $1\n"
    )
    editor.chmod(0o700)
    command = [sys.executable, "-m", "posecast_relay.cli", "robots", "edit", "--robots", str(path)]
    edit = subprocess.Popen(
        command, stdin=terminal, stderr=subprocess.PIPE, env=os.environ | {"VISUAL": str(editor)}
    )
    until("the editor is open", mark.exists)
    if theirs is None:
        path.unlink()
    else:
        run(path, "edit", theirs.encode(), "--yes")
    mark.unlink()
    said = edit.communicate(timeout=20)[1].decode()
    os.close(at)
    os.close(terminal)
    assert edit.returncode == 2
    assert (path.read_text() if path.exists() else None) == theirs
    kept = Path(said.strip().rpartition(" ")[2])
    assert kept.read_text() == "[robots.mine]\n"
    assert stat.S_IMODE(kept.stat().st_mode) == 0o600
    kept.unlink()


def test_without_an_editor_the_other_ways_are_named(tmp_path: Path) -> None:
    path = write(tmp_path, "[robots.hubo]\n")
    at, terminal = pty.openpty()
    command = [sys.executable, "-m", "posecast_relay.cli", "robots", "edit", "--robots", str(path)]
    for environ, says in (
        ({"PATH": "/nowhere"}, "use `robots set`, or `robots edit < FILE`"),
        ({"EDITOR": "/no/editor"}, "/no/editor: no such file or directory"),
        ({"EDITOR": "false"}, "false exited with status 1: nothing was changed"),
        ({"EDITOR": "'vi"}, "a quote is not closed"),
    ):
        kept = {name: value for name, value in os.environ.items() if name not in ("EDITOR", "VISUAL")}
        done = subprocess.run(
            command,
            stdin=terminal,
            capture_output=True,
            text=True,
            timeout=20,
            check=False,
            env=kept | environ,
        )
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert says in done.stderr
    os.close(at)
    os.close(terminal)
    assert path.read_text() == "[robots.hubo]\n"
