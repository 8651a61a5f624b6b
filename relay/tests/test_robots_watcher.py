"""The file while the relay runs."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from posecast_relay.config.robots_file import RobotsWatcher, UnreadableError, read_robots
from posecast_relay.config.robots_reader import Robots

SECRET = "C" * 43


class Watched:
    """A file that is followed, and what was told of it."""

    def __init__(self, folder: Path, text: str) -> None:
        self.path = folder / "robots.toml"
        self._written = 0
        self.write(text)
        self.told: list[Robots] = []
        self.error: Exception | None = None  # of the change
        self.read: Callable[[Path], Robots] = read_robots
        self.beside = folder / "relay.pem"
        self.watch = RobotsWatcher(self.path, read_robots(self.path), self._tell, self._read, [self.beside])

    async def _tell(self, robots: Robots) -> None:
        self.told.append(robots)
        if self.error is not None:
            raise self.error

    def _read(self, path: Path) -> Robots:
        return self.read(path)

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


async def test_a_file_that_is_emptied_while_it_is_read_changes_nothing(tmp_path: Path) -> None:
    of = Watched(tmp_path, f"[robots.a]\nsecret = '{SECRET}'\n")

    def read_too_late(path: Path) -> Robots:
        path.write_text("")  # an editor begins to write it
        return read_robots(path)

    of.read = read_too_late
    of.write("[robots.b]\n")
    await of.watch.check_file(1.0)
    assert (of.told, of.watch.refused) == ([], 1)
    assert of.watch.trouble == f"{of.path}: is empty; if you want no robots, leave a comment in it"


async def test_a_credential_that_expires_is_told(tmp_path: Path) -> None:
    of = Watched(tmp_path, f"[robots.a]\nsecret = '{SECRET}'\nexpires = 2100-01-01T00:00:00Z\n")
    expires_s = of.watch.robots.enrolled["a"].expires_s
    await of.watch.check_file(expires_s - 1)
    assert of.told == []
    await of.watch.check_file(expires_s)
    await of.watch.check_file(expires_s + 1)
    assert [robots.find_secrets(expires_s) for robots in of.told] == [{}]


async def test_what_changed_while_the_relay_started_is_told(tmp_path: Path) -> None:
    of = Watched(tmp_path, "[robots.a]\n")
    of.watch = RobotsWatcher(of.path, Robots({}), of._tell)  # as it was read some seconds ago
    await of.watch.check_file(1.0)
    assert [list(robots.enrolled) for robots in of.told] == [["a"]]


async def test_a_file_that_cannot_be_read_is_tried_again_and_said_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    of = Watched(tmp_path, f"[robots.a]\nsecret = '{SECRET}'\n")
    await of.watch.check_file(0.5)

    def fail(path: Path) -> Robots:
        raise UnreadableError(f"{path}: too many open files")

    of.read = fail
    of.write("[robots.b]\n")
    for at in (1.0, 2.0, 3.0):
        await of.watch.check_file(at)
    assert (of.told, of.watch.refused) == ([], 1)
    assert of.watch.trouble == f"{of.path}: too many open files"
    of.read = read_robots  # nothing about the file has changed
    await of.watch.check_file(4.0)
    await of.watch.check_file(5.0)
    assert [list(robots.enrolled) for robots in of.told] == [["b"]]
    assert of.watch.trouble is None
    assert [record.getMessage() for record in caplog.records] == [
        f"{of.path}: too many open files; its last good version stays in force",
        f"{of.path}: is valid again",
    ]


async def test_a_mistake_is_said_once_until_the_file_is_another_one(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    of = Watched(tmp_path, "[robots.a]\n")
    for text, times in (("[robots.a]\nx = 1\n", 3), ("[robots.a]\ny = 1\n", 2), ("[robots.a]\n", 2)):
        of.write(text)
        for at in range(times):
            await of.watch.check_file(1.0 + at)
    said = [record.getMessage() for record in caplog.records]
    assert len(said) == 3
    assert "unknown field 'x'" in said[0]
    assert "unknown field 'y'" in said[1]
    assert said[2] == f"{of.path}: is valid again"
    assert of.told == [], "it says the same as at first"


async def test_a_change_of_owner_or_mode_is_one(tmp_path: Path) -> None:
    of = Watched(tmp_path, "[robots.a]\n")
    await of.watch.check_file(0.5)
    of.path.write_text("[robots.b]\n")
    of.path.chmod(0o644)
    await of.watch.check_file(1.0)
    assert of.watch.trouble is not None
    of.path.chmod(0o600)
    await of.watch.check_file(2.0)
    assert [list(robots.enrolled) for robots in of.told] == [["b"]]


async def test_a_certificate_beside_it_is_told_once_it_stands_still(tmp_path: Path) -> None:
    of = Watched(tmp_path, "[robots.a]\n")
    await of.watch.check_file(0.5)
    assert of.told == []
    for text in ("one", "another", "another"):
        of.beside.write_text(text)
        os.utime(of.beside, ns=(len(text), len(text)))
        await of.watch.check_file(1.0)
        assert of.told == [], "its key may not be there yet"
    await of.watch.check_file(2.0)
    await of.watch.check_file(3.0)
    assert len(of.told) == 1


@pytest.mark.parametrize("error", [OSError("/tmp: no space left on device"), KeyError("a mistake of ours")])
async def test_a_change_that_fails_is_tried_again_less_and_less_often(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, error: Exception
) -> None:
    of = Watched(tmp_path, "[robots.a]\n")
    await of.watch.check_file(0.5)
    of.error = error
    of.write("[robots.b]\n")
    tried = []
    for check in range(50):
        before = len(of.told)
        await of.watch.check_file(1.0)
        tried += [check] * (len(of.told) - before)
    assert tried == [0, 2, 6, 14, 30, 47]
    assert of.watch.failure == str(error)
    of.write("[robots.c]\n")
    await of.watch.check_file(1.0)
    assert list(of.told[-1].enrolled) == ["c"], "a newer version does not wait"
    of.error = None
    for _ in range(40):
        await of.watch.check_file(1.0)
    assert len(of.told) == 8
    assert list(of.told[-1].enrolled) == ["c"]
    assert of.watch.failure is None
    why = repr(error) if isinstance(error, KeyError) else str(error)
    assert [record.getMessage() for record in caplog.records] == [
        f"{of.path}: its last change is not in force: {why}; retrying",
        f"{of.path}: its last change is in force",
    ]
