"""The commands of the pages on robots, access and the archive do what the pages say, one after the other."""

from __future__ import annotations

import ast
import os
import pty
import re
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from datetime import timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from posecast_relay.config.robots_file import read_robots
from posecast_relay.config.robots_reader import Robots
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.core.policy import Audience, Rule
from posecast_relay.http.metrics import ArchiveFigures, RelayCollector
from posecast_relay.kit import Breaker
from posecast_relay.past.memory import MemoryPast
from posecast_relay.past.service import HeldRequests
from posecast_relay.redis.past_writer import RedisPastWriter
from posecast_relay.redis.store import RedisStore
from posecast_relay.runtime.dispatcher import Dispatcher
from posecast_relay.runtime.fan_out import FanOut

from .certificates import certificates
from .operator_pages import DOCS, PAGES, list_commands

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


# ---- the commands of docs/how-to/operate/delete-the-past.md delete what the page says, and no more ----


HOUR, DAYS, ALL = [
    line for line in list_commands("how-to/operate/delete-the-past.md") if "past delete" in line
]
INSIDE_MS, DAY_BEFORE_MS, LATER_MS = (
    1795357260112,
    1795270860112,
    1795368060112,
)  # 14:21Z, a day before, 17:21Z
Delete = Callable[[str], set[str]]


def name_segment(view: str, from_ms: int) -> str:
    """A segment of two seconds, where the archive has it."""
    ten_minutes = time.strftime("%Y-%m-%d/%H-%M", time.gmtime(from_ms // 600_000 * 600))
    return f"hubo/{view}/{ten_minutes}/{from_ms}-{from_ms + 2000}-8f14e45fceea167b-1-7-a.segment"


def put_segment(store: Path, view: str, from_ms: int) -> None:
    path = store / name_segment(view, from_ms)
    path.parent.mkdir(parents=True)
    path.write_bytes(b"segment")


@pytest.fixture
def delete(tmp_path: Path) -> Delete:
    """Carry out a command of the page; the segments that are left."""
    for view in ("public", "staff"):
        for from_ms in (INSIDE_MS, DAY_BEFORE_MS, LATER_MS):
            put_segment(tmp_path, view, from_ms)

    def carry_out(command: str) -> set[str]:
        environ = os.environ | {
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "POSECAST_PAST": f"file://{tmp_path}",
            "TZ": "UTC",
        }
        script = ["bash", "-euc", f"{command} --yes"]
        done = subprocess.run(script, env=environ, capture_output=True, text=True, check=False, timeout=60)
        assert done.returncode == 0, done.stderr
        return {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.segment")}

    return carry_out


def test_an_hour_of_all_views(delete: Delete) -> None:
    others = (DAY_BEFORE_MS, LATER_MS)
    assert delete(HOUR) == {name_segment(view, at) for view in ("public", "staff") for at in others}


def test_two_days_of_one_view(delete: Delete) -> None:
    assert delete(DAYS) == {name_segment("public", at) for at in (INSIDE_MS, DAY_BEFORE_MS, LATER_MS)}


def test_everything_until_now(delete: Delete, tmp_path: Path) -> None:
    now_ms = round(time.time() * 1000)
    put_segment(tmp_path, "both", now_ms - 3_600_000)
    put_segment(tmp_path, "both", now_ms + 3_600_000)
    left = delete(ALL)
    assert {name for name in left if "/both/" in name} == {name_segment("both", now_ms + 3_600_000)}


# ---- docs/reference/metrics.md has every series of the relay, and no page for operators names another ----


METRICS_PAGE = (DOCS / "reference/metrics.md").read_text()


async def test_every_series_is_explained_and_no_other() -> None:
    hub = Hub(Limits())

    def described(_robot: Any) -> dict[str, Any]:
        return {}

    store = RedisStore("redis://nowhere", hub, Dispatcher.now, described)
    dispatcher = Dispatcher(hub, store, FanOut(None))
    mirror = SimpleNamespace(written=Counter(), breaker=Breaker())
    connection = RedisPastWriter("redis://nowhere", 1 << 20)
    kept, held = MemoryPast(1 << 20), HeldRequests()
    archive = SimpleNamespace(measure=lambda: ArchiveFigures(None, 0, 0, 0, 0, 0, 0, 1, 2))
    figures = RelayCollector(
        [dispatcher], mirror, past=kept, connection=connection, held=held, archive=archive
    )
    there = {family.name + ("_total" if family.type == "counter" else "") for family in figures.collect()}
    rows = re.findall(r"^\| `(posecast_\w+)", METRICS_PAGE, re.MULTILINE)
    assert sorted(rows) == sorted(there)
    networks = {"posecast_web"}  # of Docker
    for page in PAGES:
        named = re.findall(r"\bposecast_[a-z_]+(?![a-z_:])", page.read_text())  # with a colon, it is a volume
        assert {name.removesuffix("_bucket") for name in named} <= there | networks, page


# ---- docs/reference/log-messages.md has every message of the relay's log, and no other ----


ROOT = Path(__file__).resolve().parents[2]
LOG_PAGE = (ROOT / "docs/reference/log-messages.md").read_text(encoding="utf-8")
SOURCES = sorted((ROOT / "relay/src").rglob("*.py"))
LEVELS = {"exception": "error", "log": "warning"}  # what a call of that name is on the page
NAMES = {"info", "warning", "error", "critical", *LEVELS}
PLACE = re.compile(r"%[.\d]*[sdfgr]")


def list_messages(source: str) -> Iterator[tuple[str, str]]:
    """Message and level of each call `log.…("…")`; `…` for each value that is put in."""
    for node in ast.walk(ast.parse(source)):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
            continue
        if ast.unparse(node.func.value) != "log" or node.func.attr not in NAMES:
            continue
        text = node.args[1 if node.func.attr == "log" else 0]
        assert isinstance(text, ast.Constant), f"a message that the page can't have: {ast.unparse(text)}"
        message = PLACE.sub("…", str(text.value))
        # without any words of its own it is another message, passed on
        if re.search(r"\w", message) and node.func.attr != "exception":
            yield message, LEVELS.get(node.func.attr, node.func.attr)


def test_the_page_has_every_message_with_its_level() -> None:
    found = {each for path in SOURCES for each in list_messages(path.read_text(encoding="utf-8"))}
    rows = re.findall(r"^\| (`+) ?(.+?) ?\1 \| (\w+) \|", LOG_PAGE, re.MULTILINE)
    shown = [(message, level) for _, message, level in rows]
    assert len(shown) == len(set(shown))
    assert {each for each in shown if re.search(r"\w", each[0])} == found


def test_a_message_is_found_wherever_it_is_written() -> None:
    source = 'log.log(level, "a: %s", b)\nif x:\n    log.error("c %.3g: " "%d", 1, 2)\nlog.info("%s", e)\n'
    assert set(list_messages(source)) == {("a: …", "warning"), ("c …: …", "error")}


# ---- every row of the tables of threats names tests that exist -----------------------


REPO = Path(__file__).resolve().parents[2]
THREATS = REPO / "docs/reference/threats.md"
HEAD = "| threat | defence | proven by |"


def test_every_threat_has_a_test_that_exists() -> None:
    rows = [line for line in THREATS.read_text().splitlines() if line.startswith("| ") and line != HEAD]
    assert len(rows) > 70
    for row in rows:
        named = re.findall(r"`([\w./-]+)::([^`]+)`", row.split(" | ")[-1])
        assert named, row
        for file, test in named:
            text = (REPO / file).read_text()
            there = (
                rf"def {test}\("
                if file.endswith(".py")
                else rf"\bit(\.\w+\(!?\w+\))?\(\s*'{re.escape(test)}'"
            )
            assert re.search(there, text), f"{file} has no {test}"
