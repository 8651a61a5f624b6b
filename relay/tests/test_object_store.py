"""The port to object stores, over a folder."""

from __future__ import annotations

import os
import re
import socket
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from posecast_relay.archive.store import LISTED, ArchiveAway, ArchiveRefused, ObjectStore, open_object_store
from posecast_relay.config.store_url import StoreUrlError, check_store_url
from posecast_wire.command_line.installation import advise_extra


@pytest.fixture
def store(tmp_path: Path) -> ObjectStore:
    return open_object_store(f"file://{tmp_path}/store")


async def list_all(store: ObjectStore, prefix: str = "") -> dict[str, int]:
    return {each.key: each.size async for part in store.list_objects(prefix) for each in part}


async def test_put_get_list_delete(store: ObjectStore) -> None:
    await store.put("r/public/a", b"0123456789")
    await store.put("r/public/a", b"9876543210")
    await store.put("r/other/b", b"")
    assert await store.get("r/public/a") == b"9876543210"
    assert await store.get("r/other/b") == b""
    assert await store.get("r/public/none") is None
    assert await store.get_range("r/public/a", 2, 3) == b"765"
    assert await store.get_range("r/public/none", 2, 3) is None
    assert await store.get_range("r/other/b", 0, 3) == b""
    assert await store.get_range("r/public/a", 10, 3) == b""
    assert await list_all(store) == {"r/public/a": 10, "r/other/b": 0}
    assert await list_all(store, "r/public") == {"r/public/a": 10}
    assert await list_all(store, "nothing/here") == {}
    assert await store.list_folders("r") == ["other", "public"]
    assert await store.list_folders("none") == []
    await store.delete("r/public/a")
    await store.delete("r/public/a")
    assert await store.list_folders("r") == ["other"]  # empty folders go
    free = await store.measure_free()
    assert free is not None
    assert 0 < free.free <= free.total


async def test_long_listings_come_in_parts(store: ObjectStore) -> None:
    folder = store.folder
    assert folder is not None
    (folder / "many").mkdir()
    for n in range(LISTED + 10):
        (folder / "many" / f"{n}").touch()
    parts = [part async for part in store.list_objects("many")]
    assert [len(part) for part in parts] == [LISTED, 10]


async def test_what_strangers_put_there_harms_nothing(store: ObjectStore) -> None:
    folder = store.folder
    assert folder is not None
    await store.put("r/public/a", b"1")
    (folder / "r" / "a line\nbreak").write_text("x")
    (folder / "r" / "loop").symlink_to(folder)
    (folder / "r" / "gone").symlink_to("/nowhere")
    os.mkfifo(folder / "r" / "pipe")
    deep = folder / "deep"
    for _ in range(20):
        deep /= "d"
    deep.mkdir(parents=True)
    (deep / "f").touch()
    assert set(await list_all(store)) == {"r/public/a", "r/a line\nbreak"}
    assert await store.list_folders("r") == ["public"]
    with pytest.raises(ArchiveRefused, match=r"^something else is in the place"):
        await store.put("r/public/a/b", b"")


async def test_a_file_store_that_can_not_be_written(store: ObjectStore) -> None:
    if os.geteuid() == 0:
        pytest.skip("root may write everywhere")
    assert store.folder is not None
    store.folder.chmod(stat.S_IRUSR | stat.S_IXUSR)
    with pytest.raises(ArchiveRefused, match=r"^permission denied$"):
        await store.put("r/public/a", b"1")


@pytest.fixture
def deaf() -> Iterator[int]:
    """A port at which connections are accepted and nothing is ever said."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


async def test_a_server_that_is_away_or_silent(monkeypatch: pytest.MonkeyPatch, deaf: int) -> None:
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "SECRETID")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "SECRETKEY")
    monkeypatch.setenv("AWS_REGION", "us-east-1")
    for port in (deaf, 1):
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{port}")
        store = open_object_store("s3://bucket/prefix", call_s=0.5)
        with pytest.raises(ArchiveAway) as caught:
            await store.put("r/public/a", b"1")
        said = str(caught.value)
        assert not any(word in said for word in ("127.0.0.1", "SECRET", "\n", "bucket/"))


@pytest.mark.parametrize(
    "url",
    ["file://", "file:///", "s3:/b", "s3://", "http://x/y", "s3://b?x=1",
     "file:///a/../../etc", "s3://b\n", "redis://x", "s3://key:secret@b/x"],
)  # fmt: skip
def test_what_is_no_url_of_a_store(url: str) -> None:
    with pytest.raises(StoreUrlError, match=r"^use file:///FOLDER"):
        check_store_url(url)


@pytest.mark.parametrize(
    ("url", "told"),
    [
        ("/tmp/x", "write file:///tmp/x"),
        ("file://localhost/x", "use file:///FOLDER without a host, with three slashes"),
        ("file://host/x", "use three slashes and an absolute path: file:///FOLDER"),
        ("file:x", "use three slashes and an absolute path: file:///FOLDER"),
        ("file:///a b", "write %20 for each space"),
    ],
)
def test_a_url_of_a_folder_that_is_nearly_right(url: str, told: str) -> None:
    with pytest.raises(StoreUrlError) as caught:
        check_store_url(url)
    assert str(caught.value) == told


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(StoreUrlError, match=r"^this is a file, not a folder$"):
        open_object_store(f"file://{tmp_path}/file")


def test_a_folder_that_can_not_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(StoreUrlError) as caught:
        open_object_store(f"file://{tmp_path}/file/x")
    assert "\n" not in str(caught.value)


def test_without_the_extra_it_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "obstore.store", None)
    with pytest.raises(StoreUrlError, match=f"^{re.escape(advise_extra('posecast-relay', 'archive'))}$"):
        open_object_store(f"file://{tmp_path}/store")


def test_a_relay_whose_store_can_not_be_opened_says_so(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    command = [sys.executable, "-m", "posecast_relay.cli", "run", "--dev", "--port", "0"]
    command += ["--zenoh-listen", "tcp/127.0.0.1:0", "--past", f"file://{tmp_path}/file/x"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith(f"posecast-relay: --past file://{tmp_path}/file/x: ")
    assert done.stderr.count("\n") == 1
