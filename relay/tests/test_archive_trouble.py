"""What is wrong with a store while no robot is on air: said once, in the log and by the process's state."""

from __future__ import annotations

import logging
import shutil
import stat
from pathlib import Path

import pytest
from posecast_relay.archive.deletion import TombstoneFollower
from posecast_relay.archive.store import (
    ArchiveError,
    ArchiveRefused,
    FreeSpace,
    SpaceWatch,
    open_object_store,
)
from posecast_relay.archive.upkeep import PROBE_KEY
from posecast_relay.config.settings import StartError, parse
from posecast_relay.past.deletions import Deletions
from posecast_relay.server.archive import ArchiveServices, make_archive
from posecast_testing import until_async

from .archive_world import ArchiveWorld

RELAY = ("run", "--dev", "--past")


def make(folder: Path, *more: str) -> ArchiveServices:
    """The archive of a process."""
    archive = make_archive(parse([*RELAY, f"file://{folder}", *more], {}), Deletions())
    assert archive is not None
    return archive


async def test_a_store_that_can_only_be_read_is_told_of_without_a_robot(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    archive, keys = make(tmp_path / "store"), list[str]()
    refused = True

    async def put(key: str, data: bytes) -> None:
        keys.append(key)
        if refused:
            raise ArchiveRefused("it is read-only")

    monkeypatch.setattr(archive.store, "put", put)
    assert archive.indexer is not None
    await archive.indexer.do_due()
    await archive.indexer.do_due()
    assert keys == [PROBE_KEY]
    assert archive.measure().trouble == archive.find_trouble() == "it is read-only"
    refused = False
    archive.indexer._probe_at = 0.0
    await archive.indexer.do_due()
    assert archive.measure().trouble is None
    assert [record.message for record in caplog.records if "disk" not in record.message] == [
        "the archive: it is read-only; retrying until it works",
        "the archive: the store works again",
    ]


async def test_who_probes_leaves_nothing_there(tmp_path: Path) -> None:
    archive = make(tmp_path / "store")
    assert archive.indexer is not None
    await archive.indexer.do_due()
    assert archive.measure().trouble is None
    assert [path for path in (tmp_path / "store").rglob("*") if path.is_file()] == []


async def test_a_folder_that_is_gone_is_told_of_once_and_is_no_mistake_of_ours(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    world = ArchiveWorld(tmp_path / "store")
    trouble = world.indexer.trouble
    follower = TombstoneFollower(world.store, Deletions(), lambda: 0, erases=True, trouble=trouble)
    shutil.move(world.folder, tmp_path / "aside")
    world.indexer.start()
    try:
        await until_async("it is seen", lambda: world.indexer.failures > 1)
        with pytest.raises(ArchiveError):
            await follower.look()
        assert trouble.find_trouble() == "its folder is gone"
        assert not (tmp_path / "store").exists()
        shutil.move(tmp_path / "aside", world.folder)
        world.indexer._probe_at = 0.0
        await until_async("it is over", lambda: trouble.find_trouble() is None)
    finally:
        await world.indexer.stop()
    told = [record.message for record in caplog.records if "disk" not in record.message]
    assert told[0] == "the archive: its folder is gone; retrying until it works"
    assert len(told) == 2
    assert all(record.levelno == logging.WARNING for record in caplog.records)


async def test_the_rule_that_struck_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    store = open_object_store(f"file://{tmp_path}/store")
    left = FreeSpace(3 << 20, 3 << 20)  # a small disk, and empty

    async def measure() -> FreeSpace:
        return left

    store.measure_free = measure  # type: ignore[method-assign]
    watch = SpaceWatch(store)
    await watch.look()
    assert watch.find_trouble() is None
    left = FreeSpace(499 << 20, 2000 << 20)
    await watch.look()
    assert watch.find_trouble() == "the disk is nearly full: less than 25 % is left, 499 MB, 24 % of it"
    left = FreeSpace(599 << 20, 2000 << 20)  # a little more: not yet enough
    await watch.look()
    assert str(watch.find_trouble()).endswith("less than 25 % is left, 599 MB, 29 % of it")
    left = FreeSpace(600 << 20, 2000 << 20)
    await watch.look()
    assert watch.find_trouble() is None
    left = FreeSpace(1023 << 20, 8 << 30)
    await watch.look()
    assert watch.find_trouble() == "the disk is nearly full: less than 1 GiB is left, 1023 MB, 12 % of it"
    left = FreeSpace(1 << 40, 1 << 41)
    await watch.look()
    assert watch.find_trouble() is None
    left = FreeSpace(2 << 30, 1 << 40)
    await watch.look()
    assert [record.message for record in caplog.records] == [
        "the archive: the disk is nearly full: less than 25 % is left, 499 MB, 24 % of it",
        "the archive: the disk has room again: 600 MB, 30 % of it",
        "the archive: the disk is nearly full: less than 1 GiB is left, 1023 MB, 12 % of it",
        "the archive: the disk has room again: 1048576 MB, 50 % of it",
        "the archive: the disk is nearly full: less than 10 % is left, 2048 MB, 0 % of it",
    ]


async def test_a_disk_that_is_gone_has_no_room_again(tmp_path: Path) -> None:
    store = open_object_store(f"file://{tmp_path}/store")
    store._device = -1  # another one than what lies there now
    with pytest.raises(ArchiveRefused, match=r"^its disk is not mounted$"):
        await store.measure_free()


def test_a_gateway_makes_no_folder(tmp_path: Path) -> None:
    with pytest.raises(StartError, match=r"there is no such folder$"):
        make(tmp_path / "store", "--role", "gateway", "--store", "redis://x")
    assert not (tmp_path / "store").exists()


def test_a_new_folder_is_for_its_user_alone(tmp_path: Path) -> None:
    assert make(tmp_path / "store").store.is_new
    assert stat.S_IMODE((tmp_path / "store").stat().st_mode) == 0o700
    assert not make(tmp_path / "store").store.is_new


async def test_s3_without_keys_names_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("AWS_ACCESS_KEY_ID", raising=False)
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    monkeypatch.setenv("AWS_REGION", "us-east-1")
    with pytest.raises(ArchiveError, match=r"set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY$"):
        await open_object_store("s3://bucket/lab", call_s=1.0).put("a", b"")
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "x")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "y")
    with pytest.raises(ArchiveError) as told:
        await open_object_store("s3://bucket/lab", call_s=1.0).put("a", b"")
    assert "AWS" not in str(told.value)
