"""`posecast-relay robots`: credentials made, changed and forgotten."""

from __future__ import annotations

import os
import pty
import re
import resource
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path

import pytest
from posecast_relay.config.robots_changes import RobotsDocument
from posecast_relay.config.robots_command import list_credential_changes
from posecast_relay.config.robots_file import read_robots
from posecast_relay.config.robots_reader import MISTAKES_MAX, Robots, RobotsError, parse_robots
from posecast_relay.core.policy import Audience, Rule, read_link
from posecast_testing import until
from posecast_wire import Credential

from .certificates import certificates
from .command import run_command


def robots(path: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run it."""
    return run_command("robots", words[0], "--robots", str(path), *words[1:])


def refused(path: Path, *words: str) -> str:
    """The one line of a command that ends with status 2 and changes nothing."""
    before = path.read_bytes() if path.exists() else None
    done = robots(path, *words)
    assert (done.returncode, done.stdout) == (2, "")
    assert (path.read_bytes() if path.exists() else None) == before
    assert done.stderr.count("\n") == 1
    return done.stderr


def test_the_last_robot_is_removed_from_a_file_that_has_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "robots.toml"
    robots(path, "add", "hubo")
    path.write_text("\n".join(line for line in path.read_text().splitlines() if not line.startswith("#")))
    robots(path, "remove", "hubo")
    assert read_robots(path).find_secrets(0.0) == {}
    assert path.read_text().startswith("# ")  # a running relay takes an empty file for one half written


def test_a_robot_is_added_rotated_listed_and_removed(tmp_path: Path) -> None:
    path = tmp_path / "robots.toml"
    done = robots(path, "add", "hubo")
    first = Credential.parse(done.stdout)
    assert first.robot == "hubo"
    assert first.secret not in done.stderr
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert read_robots(path).find_secrets(0.0) == {"hubo": first.secret}

    path.write_text(path.read_text() + "\n# the one with the red arm\n")
    path.chmod(0o640)
    second = Credential.parse(robots(path, "rotate", "hubo", "--days", "30").stdout)
    assert second.secret != first.secret
    assert read_robots(path).find_secrets(0.0) == {"hubo": second.secret}
    assert read_robots(path).find_secrets(1e11) == {}
    assert "# the one with the red arm" in path.read_text()
    assert stat.S_IMODE(path.stat().st_mode) == 0o640

    robots(path, "add", "g1", "--private")
    path.write_text(path.read_text() + '[robots.h1.anyone]\npast = "90s"\n[robots.h1.link]\npast = 0\n')
    assert "anyone: public (90 s back), link: public (no past)" in robots(path, "list").stdout
    robots(path, "remove", "h1")
    listed = robots(path, "list").stdout
    assert [line.split("\t")[0] for line in listed.splitlines()] == ["g1", "hubo"]
    assert "g1\tuntil removed\tnobody" in listed
    assert listed.rstrip().endswith("anyone: public (30 min back)")
    assert second.secret not in listed

    done = robots(path, "add", "g2", "--certificate", "--days", "30")
    assert (done.returncode, done.stdout) == (0, "")
    assert "g2\tby certificate only, until " in robots(path, "list").stdout
    assert "g2" not in read_robots(path).find_secrets(0.0)
    assert "g2" in read_robots(path).list_publishers(0.0)
    assert "g2" not in read_robots(path).list_publishers(1e11)
    assert robots(path, "remove", "g2").returncode == 0

    assert robots(path, "remove", "hubo").returncode == 0
    assert read_robots(path).find_secrets(0.0).keys() == {"g1"}
    assert [each.name for each in tmp_path.iterdir()] == ["robots.toml"]


def test_the_authority_goes_along(tmp_path: Path) -> None:
    certificates(tmp_path)
    done = robots(tmp_path / "robots.toml", "add", "hubo", "--ca", str(tmp_path / "ca.pem"))
    found = Credential.parse(done.stdout)
    assert found.ca is not None
    assert "".join(found.ca.split()) == "".join((tmp_path / "ca.pem").read_text().split())


def test_a_byte_order_mark_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "robots.toml"
    path.write_bytes(b"\xef\xbb\xbf[robots.hubo]\n")
    path.chmod(0o600)
    Credential.parse(robots(path, "add", "nao").stdout)
    assert robots(path, "remove", "hubo").returncode == 0, "it is still in the file"


def test_what_cannot_be_done_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "robots.toml"
    assert "no robot 'hubo' in" in refused(path, "remove", "hubo")
    assert "robot '*'" in refused(path, "add", "*")
    assert "--ca" in refused(path, "add", "hubo", "--ca", "/nowhere")
    assert "no certificate in PEM form" in refused(path, "add", "hubo", "--ca", __file__)
    assert "use a number of days" in refused(path, "add", "hubo", "--days", "0")
    assert "no such file or directory" in refused(tmp_path / "none" / "robots.toml", "add", "hubo")
    robots(path, "add", "hubo")
    assert "already has a credential" in refused(path, "add", "hubo")
    path.write_text("[robots.hubo]\nsecrte = 1\n")
    assert "unknown field 'secrte'" in refused(path, "add", "g1")
    done = run_command("robots", "list")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "give --robots FILE" in done.stderr


def test_a_file_that_can_not_be_written_is_no_wrong_argument(tmp_path: Path) -> None:
    path = tmp_path / "robots.toml"
    robots(path, "add", "hubo")
    before = path.read_text()
    command = [sys.executable, "-m", "posecast_relay.cli", "robots", "--robots", str(path)]
    for words in (("add", "g1"), ("set", "hubo", "--anyone", "hz=5"), ("remove", "hubo")):
        done = subprocess.run(
            [*command[:4], words[0], *command[4:], *words[1:]],
            capture_output=True,
            text=True,
            timeout=20,
            check=False,
            # the nearest to a full disk that needs no disk
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0)),
        )
        said = f"posecast-relay: {path}: file too large\n"
        assert (done.returncode, done.stdout, done.stderr) == (1, "", said), words
        assert path.read_text() == before
    assert [each.name for each in tmp_path.iterdir()] == ["robots.toml"]


def test_share_links_are_made_and_ended(tmp_path: Path) -> None:
    path = tmp_path / "robots.toml"
    robots(path, "add", "hubo")
    assert "no [robots.hubo.link] in" in refused(path, "link", "hubo")
    path.write_text(path.read_text() + '\n[robots.hubo.link]\nview = "lab"\n')
    line = robots(path, "link", "hubo", "--url", "https://relay.example/").stdout
    head, _, token = line.strip().partition("?t=")
    assert head == "https://relay.example/#/r/hubo"
    keys = read_robots(path).find_link_keys()
    now_s = time.time()
    assert read_link(token, keys, now_s + 6.9 * 86400) is not None
    assert read_link(token, keys, now_s + 7.1 * 86400) is None
    again = robots(path, "link", "hubo").stdout.strip().partition("?t=")[2]
    assert again != token
    assert read_link(again, keys, now_s) is not None
    robots(path, "unlink", "hubo")
    assert read_link(again, read_robots(path).find_link_keys(), now_s) is None
    assert read_robots(path).make_policy().find_rules("hubo")[Audience.LINK] == Rule("lab")


def test_the_list_says_what_each_audience_may_look_back_on(tmp_path: Path) -> None:
    path = tmp_path / "robots.toml"
    tables = {
        "anyone": 'past = "3d"',
        "signed-in": "delay_s = 5",
        "link": 'delay_s = 5\npast = "30s"',
    }
    path.write_text("".join(f"[robots.h1.{audience}]\n{rule}\n" for audience, rule in tables.items()))
    path.chmod(0o600)
    shown = robots(path, "list").stdout.rstrip().split("\t")[-1]
    assert shown.split("), ") == [
        "anyone: public (3 d back",
        "signed-in: public (5 s late, no past",
        "link: public (5 s late, 30 s back)",
    ]


def test_the_list_says_blackout_and_what_ends_it(tmp_path: Path) -> None:
    path = tmp_path / "robots.toml"
    robots(path, "add", "hubo")
    robots(path, "set", "hubo", "--anyone", "blackout=true")
    shown = robots(path, "list").stdout.rstrip().split("\t")[-1]
    found = re.fullmatch(r"anyone: nothing \(blackout; to end it: robots set NAME (.+ .+)\)", shown)
    assert found is not None, shown
    robots(path, "set", "hubo", *found[1].split())
    assert robots(path, "list").stdout.rstrip().endswith("\tanyone: public (30 min back)")


def test_who_may_watch_is_said_without_an_editor(tmp_path: Path) -> None:
    path = tmp_path / "robots.toml"
    robots(path, "add", "hubo")
    path.write_text(path.read_text() + "# by the door\n")
    before = path.read_text()
    words = ["--anyone", "view=public", "delay_s=10", "frames=https://a.example,https://b.example"]
    done = robots(path, "set", "hubo", *words, "--link", "view=7", "past=2h", "blackout=false")
    assert done.returncode == 0, done.stderr
    assert done.stderr == (
        "Who can watch 'hubo': anyone: public (10 s late, no past), link: 7 (2 h back).\n"
        "View '7' shows nothing unless the robot's profile defines it; "
        "/admin lists the views that the robot sends.\n"
    )
    rules = read_robots(path).enrolled["hubo"].rules
    assert rules == {
        Audience.ANYONE: Rule(delay_s=10.0, frames=("https://a.example", "https://b.example")),
        Audience.LINK: Rule("7", past_s=7200.0),
    }
    assert "# by the door" in path.read_text()
    assert (tmp_path / "robots.toml.bak").read_text() == before
    assert stat.S_IMODE((tmp_path / "robots.toml.bak").stat().st_mode) == 0o600

    robots(path, "set", "hubo", "--anyone", "delay_s=", "viewers=3", "--link", "nothing", "--keep", "30d")
    hubo = read_robots(path).enrolled["hubo"]
    assert hubo.rules == {Audience.ANYONE: Rule(viewers=3, frames=("https://a.example", "https://b.example"))}
    assert hubo.keep_s == 30 * 86400.0
    robots(path, "set", "hubo", "--keep", "0")
    assert read_robots(path).enrolled["hubo"].keep_s is None
    assert robots(path, "link", "hubo").returncode == 2
    robots(path, "set", "hubo", "--link", "view=public")
    assert robots(path, "link", "hubo").stdout.startswith("#/r/hubo?t=")


def test_what_cannot_be_set_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "robots.toml"
    robots(path, "add", "hubo")
    assert "give a rule, such as --anyone view=public" in refused(path, "set", "hubo")
    assert "no robot 'g1' in" in refused(path, "set", "g1", "--anyone", "view=public")
    assert "--anyone hertz=3: use FIELD=VALUE" in refused(path, "set", "hubo", "--anyone", "hertz=3")
    assert "--anyone hz: use FIELD=VALUE" in refused(path, "set", "hubo", "--anyone", "hz")
    said = refused(path, "set", "hubo", "--anyone", "delay_s=61")
    assert said.startswith(
        f"posecast-relay: {path}: [robots.hubo.anyone] delay_s: want a number from 0 to 60"
    )
    assert "hz: want a number" in refused(path, "set", "hubo", "--link", "hz=many")
    assert "two delays for view" in refused(
        path, "set", "hubo", "--anyone", "delay_s=1", "--link", "delay_s=2"
    )
    assert [each.name for each in tmp_path.iterdir()] == ["robots.toml"]


def test_a_rotation_in_two_steps(tmp_path: Path) -> None:
    path = tmp_path / "robots.toml"
    first = Credential.parse(robots(path, "add", "hubo").stdout)
    assert "no rotation of 'hubo' has begun" in refused(path, "rotate", "hubo", "--finish")
    assert "give --days with --finish" in refused(path, "rotate", "hubo", "--begin", "--days", "3")
    assert "not allowed with argument" in refused(path, "rotate", "hubo", "--begin", "--finish")
    done = robots(path, "rotate", "hubo", "--begin")
    assert "does not work until you run `robots rotate hubo --finish`" in done.stderr
    assert "replaces" not in done.stderr
    second = Credential.parse(done.stdout)
    assert read_robots(path).find_secrets(0.0) == {"hubo": first.secret}
    assert robots(path, "rotate", "hubo", "--finish", "--days", "3").stdout == ""
    assert read_robots(path).find_secrets(0.0) == {"hubo": second.secret}
    assert read_robots(path).find_secrets(1e11) == {}

    lost = Credential.parse(robots(path, "rotate", "hubo", "--begin").stdout)
    done = robots(path, "rotate", "hubo", "--begin")
    assert "It replaces the one from an earlier --begin." in done.stderr
    robots(path, "rotate", "hubo", "--finish")
    assert Credential.parse(done.stdout).secret != lost.secret
    assert read_robots(path).find_secrets(0.0) == {"hubo": Credential.parse(done.stdout).secret}

    robots(path, "rotate", "hubo", "--begin")
    Credential.parse(robots(path, "rotate", "hubo").stdout)  # at once: what was begun is forgotten
    assert "no rotation of 'hubo' has begun" in refused(path, "rotate", "hubo", "--finish")
    robots(path, "add", "g1", "--certificate")
    assert "uses a certificate" in refused(path, "rotate", "g1", "--begin")


# ---- `robots check` and `robots edit`: what is wrong is said whole, and never written ----


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


# ---- what `robots edit` says of credentials: an older copy of the file brings none back unasked ----


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


# ---- what a command makes of the file's text, however its author has written it ------


SECRET = "C" * 43
FORMS = {
    "tables": f'[robots.a]\nsecret = "{SECRET}"\n[robots.a.link]\nview = "staff"\n[robots.b]\n',
    "tables apart": f'[robots.a]\nsecret = "{SECRET}"\n[admin]\nsecret = "{SECRET}"\n[robots.b]\n'
    '[robots.a.link]\nview = "staff"\n',
    "inline": f'robots = {{ a = {{ secret = "{SECRET}", link = {{ view = "staff" }} }}, b = {{}} }}\n',
    "inline in a table": f'[robots]\na = {{ secret = "{SECRET}", link = {{ view = "staff" }} }}\nb = {{}}\n',
    "dotted": f'robots.a.secret = "{SECRET}"\nrobots.a.link.view = "staff"\nrobots.b = {{}}\n',
    "dotted in a table": f'[robots]\na.secret = "{SECRET}"\na.link.view = "staff"\nb = {{}}\n',
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_toml_can_be_changed(form: str) -> None:
    text = FORMS[form]

    def change(call: Callable[[RobotsDocument], object]) -> Robots:
        nonlocal text
        doc = RobotsDocument(text, "robots.toml")
        call(doc)
        text = doc.make_text()
        return parse_robots(text)

    began = parse_robots(text)
    assert began.enrolled["a"].rules[Audience.LINK].view == "staff"
    until = datetime(2030, 1, 1, tzinfo=UTC)
    robots = change(lambda doc: doc.add_robot("c", is_private=False, expires=until, ca=None))
    assert robots.enrolled["c"].rules[Audience.ANYONE].view == "public"
    robots = change(lambda doc: doc.set_rules("a", None, {Audience.ANYONE: ["hz=10", "view=slow"]}))
    assert (robots.enrolled["a"].rules[Audience.ANYONE].hz, robots.enrolled["a"].secret) == (10.0, SECRET)
    assert robots.enrolled["a"].rules[Audience.LINK].view == "staff"
    robots = change(lambda doc: doc.make_share_link("a", until))
    assert robots.enrolled["a"].link_key is not None
    robots = change(lambda doc: doc.set_admin_secret(["10.0.0.0/8"]))
    assert robots.admin is not None
    robots = change(lambda doc: doc.remove_robot("a"))
    assert (set(robots.enrolled), robots.enrolled["b"]) == ({"b", "c"}, began.enrolled["b"])


def test_a_file_that_is_wrong_already_is_named() -> None:
    with pytest.raises(RobotsError) as error:
        RobotsDocument("[robots.a]\nx = 1\n[robots.b]\ny = 1\n", "robots.toml")
    assert len(error.value.mistakes) == 2
    assert all(mistake.startswith("robots.toml: [robots.") for mistake in error.value.mistakes)


def test_a_field_taken_out_shows_nothing_to_whoever_saw_nothing() -> None:
    doc = RobotsDocument("[robots.a]\n", "robots.toml")
    doc.set_rules("a", None, {Audience.ANYONE: ["delay_s=", "view="]})
    assert parse_robots(doc.make_text()).enrolled["a"].rules == {}
