"""docs/how-to/scale/load-tests.md: Locust started by hand in the three ways that the page shows, by its
own lines."""

from __future__ import annotations

import json
import re
import shlex
import signal
import subprocess
import sys
import urllib.parse
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import pytest
from posecast_loadtests.stage import own_relay
from posecast_testing import free_port, until

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/how-to/scale/load-tests.md").read_text()
HEADLESS, WITH_PAGE, MASTER, WORKER = re.findall(r"^```sh\n(locust .*)\n```$", PAGE, re.MULTILINE)
VIEWERS = 12
SMALLER = {
    "-u 500 -r 50 -t 60s": f"-u {VIEWERS} -r {VIEWERS} -t 5s",
    "--viewers 2000": f"--viewers {VIEWERS}",
}


class Site:
    """A relay with the demo robot, and Locusts started by the page's lines."""

    def __init__(self, folder: Path, relay: str) -> None:
        self._folder = folder
        self._relay = relay
        self.started: list[subprocess.Popen[bytes]] = []

    def start(self, line: str, *more: str) -> tuple[subprocess.Popen[bytes], Path]:
        """Start it; the process and the file of what it prints."""
        for shown, here in SMALLER.items():
            line = line.replace(shown, here)
        line = line.replace("ws://relay.lab:8080", self._relay).replace("10.0.0.5", "127.0.0.1")
        line = line.replace("load.html", str(self._folder / "load.html"))
        log = self._folder / f"{len(self.started)}.log"
        words = [f"{Path(sys.executable).parent}/locust", *shlex.split(line)[1:], *more]
        with log.open("wb") as out:
            self.started.append(subprocess.Popen(words, cwd=ROOT, stdout=out, stderr=out))
        return self.started[-1], log


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    with ExitStack() as stack:
        made = Site(tmp_path, own_relay(stack, tmp_path).address.viewers)
        try:
            yield made
        finally:
            for process in made.started:
                process.kill()
                process.wait()


def read_report(log: Path) -> dict[str, int]:
    """The counts of its newest report; what a busy machine may break is not looked at."""
    text = log.read_text()
    assert "BREACH       no viewer got a frame" not in text, text
    (viewers, refused) = re.findall(r"^viewers +(\d+) .*refused (\d+), closed early \d+", text, re.M)[-1]
    frames = re.findall(r"^frames +(\d+)", text, re.MULTILINE)[-1]
    lost = re.findall(r"(\d+) workers lost", text) or [0]
    return {
        "viewers": int(viewers),
        "frames": int(frames),
        "refused": int(refused),  # who is late may be closed early
        "lost": int(lost[-1]),
    }


def test_headless(site: Site, tmp_path: Path) -> None:
    process, log = site.start(HEADLESS)
    status = process.wait(120)
    found = read_report(log)
    assert (found["viewers"], found["refused"]) == (VIEWERS, 0)
    assert status == ("BREACH" in log.read_text())
    # Locust's own table has a tenth of them, and says so
    _, _, table = log.read_text().rpartition("# reqs      # fails")
    (row,) = re.findall(r"^WS +frame, healthy: 1 in 10 +(\d+)", table, re.MULTILINE)[:1]
    assert found["frames"] / 10 - VIEWERS <= int(row) <= found["frames"] / 10
    assert "frame, healthy: 1 in 10" in (tmp_path / "load.html").read_text()


@pytest.mark.full
def test_with_its_page_twice(site: Site) -> None:
    port = free_port()
    process, log = site.start(WITH_PAGE, "--web-host", "127.0.0.1", "--web-port", str(port))

    def ask(path: str, **form: int) -> bytes:
        data = urllib.parse.urlencode(form).encode() if form else None
        with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", data, timeout=30) as answer:
            return bytes(answer.read())

    def answers() -> bool:
        try:
            return b"Locust" in ask("/")
        except OSError:
            return False

    def have_watched(viewers: int) -> bool:
        """Whether each has been there for four seconds or so: shorter connections say nothing of fairness."""
        found = json.loads(ask("/stats/requests"))
        frames = sum(row["num_requests"] for row in found["stats"] if row["name"].startswith("frame"))
        return bool(found["user_count"] == viewers and frames >= 4 * viewers)

    until("its page", answers, 60)
    for reports, viewers in enumerate((VIEWERS, 3), 1):
        ask("/swarm", user_count=viewers, spawn_rate=viewers)
        until("frames", partial(have_watched, viewers), 60)
        ask("/stop", now=1)
        until("a report", lambda n=reports: log.read_text().count("lateness  ") == n, 60)  # type: ignore[misc]
        found = read_report(log)
        assert (found["viewers"], found["refused"]) == (viewers, 0), "it counts anew"
    process.send_signal(signal.SIGTERM)  # which it has also where a shell lets it ignore SIGINT
    assert process.wait(60) == (log.read_text().count("all limits kept") < 2)


@pytest.mark.full
def test_with_workers(site: Site) -> None:
    port = str(free_port())
    workers = [site.start(WORKER, "--master-port", port) for _ in range(2)]
    stretch = ("--stretch", "0.1", "--only-summary")
    process, log = site.start(MASTER, "--master-bind-host", "127.0.0.1", "--master-bind-port", port, *stretch)
    assert process.wait(150) in (0, 1), log.read_text()
    found = read_report(log)
    assert found["viewers"] > 0.75 * VIEWERS, "of one worker it would be half"
    assert (found["refused"], found["lost"]) == (0, 0)
    for worker, its_log in workers:
        assert worker.wait(60) == 0, its_log.read_text()


@pytest.mark.full
def test_a_worker_that_is_lost_is_a_broken_limit(site: Site) -> None:
    port = str(free_port())
    (first, _), _ = [site.start(WORKER, "--master-port", port) for _ in range(2)]
    stretch = ("--stretch", "0.1", "--only-summary")
    process, log = site.start(MASTER, "--master-bind-host", "127.0.0.1", "--master-bind-port", port, *stretch)
    until("all are there", lambda: "All users spawned" in log.read_text(), 60)
    first.kill()
    assert process.wait(150) == 1
    assert read_report(log)["lost"] == 1, log.read_text()
