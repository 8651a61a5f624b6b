"""`posecast-relay robots`: credentials made, changed and forgotten."""

from __future__ import annotations

import re
import resource
import stat
import subprocess
import sys
import time
from pathlib import Path

from posecast_relay.config.robots_file import read_robots
from posecast_relay.core.policy import Audience, Rule, read_link
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
