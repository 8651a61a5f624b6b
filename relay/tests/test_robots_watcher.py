"""The file while the relay runs."""

from __future__ import annotations

import os
from pathlib import Path

from posecast_relay.config.robots_file import read_robots
from posecast_relay.config.robots_reader import Robots
from posecast_relay.config.robots_watcher import RobotsWatcher

SECRET = "C" * 43


class Watched:
    """A file that is followed, and what was told of it."""

    def __init__(self, folder: Path, text: str) -> None:
        self.path = folder / "robots.toml"
        self._written = 0
        self.write(text)
        self.told: list[Robots] = []
        self.watch = RobotsWatcher(self.path, read_robots(self.path), self._tell)

    async def _tell(self, robots: Robots) -> None:
        self.told.append(robots)

    def write(self, text: str) -> None:
        """As an editor does; a moment later each time, by the file's own clock."""
        self.path.write_text(text)
        self.path.chmod(0o600)
        self._written += 1
        os.utime(self.path, ns=(self._written, self._written))


async def test_a_change_is_told_once(tmp_path: Path) -> None:
    of = Watched(tmp_path, "[robots.a]\n")
    await of.watch.check_file(1.0)
    assert of.told == []
    of.write(f"[robots.a]\nsecret = '{SECRET}'\n")
    for at in (2.0, 3.0):
        await of.watch.check_file(at)
    assert [robots.find_secrets(0.0) for robots in of.told] == [{"a": SECRET}]


async def test_a_wrong_or_vanished_file_changes_nothing(tmp_path: Path) -> None:
    of = Watched(tmp_path, f"[robots.a]\nsecret = '{SECRET}'\n")
    of.write("[robots.a]\nsecrte = 1\n")
    await of.watch.check_file(1.0)
    await of.watch.check_file(2.0)
    of.path.unlink()
    await of.watch.check_file(3.0)
    of.write("")
    await of.watch.check_file(3.5)
    assert of.told == []
    assert of.watch.refused == 3
    assert of.watch.robots.find_secrets(0.0) == {"a": SECRET}
    of.write("# nobody\n")
    await of.watch.check_file(4.0)
    assert [robots.find_secrets(0.0) for robots in of.told] == [{}]


async def test_a_credential_that_expires_is_told(tmp_path: Path) -> None:
    of = Watched(tmp_path, f"[robots.a]\nsecret = '{SECRET}'\nexpires = 2100-01-01T00:00:00Z\n")
    expires_s = of.watch.robots.enrolled["a"].expires_s
    await of.watch.check_file(expires_s - 1)
    assert of.told == []
    await of.watch.check_file(expires_s)
    await of.watch.check_file(expires_s + 1)
    assert [robots.find_secrets(expires_s) for robots in of.told] == [{}]
