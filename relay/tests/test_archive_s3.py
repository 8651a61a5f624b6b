"""The archive in a real S3 server: well, slow, away, refused, full, shared, and under kill -9.

Long: `make test-full`. Where versitygw is not there it is built from its Go module.
"""

from __future__ import annotations

import asyncio
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from posecast_relay.archive.names import read_segment_key
from posecast_relay.archive.store import ArchiveRefused, open_object_store
from posecast_testing import until

from .s3_server import BUCKET, Proxy, S3Server
from .stage import Model, Relay, Watcher, ZenohEdge
from .test_archive_relay import POLICY, check_readable, list_shown, list_there
from .test_past_deletion_relay import list_names, run_past
from .test_past_relay import await_segment, find_newest, write

pytestmark = pytest.mark.full

URL = f"s3://{BUCKET}/lab"
AWAY_S = 60.0
Start = Callable[..., Relay]
Edges = Callable[..., ZenohEdge]
LONG_S = 60.0


class Bucket:
    """The relay's prefix in the bucket, as the server keeps it on disk."""

    def __init__(self, server: S3Server) -> None:
        self.folder = server.folder / BUCKET / "lab"
        self.folder.mkdir(exist_ok=True)

    def has(self, take: int, last_index: int) -> bool:
        """Whether all of a take is there, up to a segment."""
        wanted = {(take, index) for index in range(last_index + 1)}
        return wanted <= set(list_there(self.folder))

    def list_pages(self) -> set[int]:
        """The ten minutes of which there is something."""
        return {name.page_ms for name in list_there(self.folder).values()}

    def is_indexed(self) -> bool:
        """Whether each ten minutes has its index."""
        return len(list(self.folder.rglob("index.json"))) == len(self.list_pages())


@pytest.fixture
def bucket(s3: S3Server) -> Bucket:
    """The bucket's folder."""
    return Bucket(s3)


@pytest.fixture
def start(tmp_path: Path, relays: Start, proxy: Proxy) -> Start:
    """Start a relay that keeps `r` in the bucket."""
    write(tmp_path / "robots.toml", POLICY)
    return lambda *flags: relays("--past", URL, "--robots", str(tmp_path / "robots.toml"), *flags)


def record_more(relay: Relay, edge: ZenohEdge, count: int) -> dict[str, Any]:
    """So many segments more."""
    newest = find_newest(relay)
    return await_segment(relay, edge, (newest["index"] if newest else -1) + count)


def get_why(relay: Relay) -> str:
    """What /readyz says is wrong."""
    return str(httpx.get(f"http://{relay.address}/readyz").json().get("why", ""))


def finish(relay: Relay, edge: ZenohEdge, bucket: Bucket, newest: dict[str, Any], start: Start) -> None:
    """Whatever happened: once it is over all is there, is shown by the next process, and is indexed."""
    take = int(newest["take"], 16)
    until("all is there", lambda: bucket.has(take, newest["index"]) or None, LONG_S)
    edge.silent = True
    assert relay.stop() == 0
    check_readable(bucket.folder)
    again = start()
    until("all is shown", lambda: list_shown(again) == set(list_there(bucket.folder)) or None, LONG_S)
    until("all is indexed", lambda: bucket.is_indexed() or None, LONG_S)
    assert again.stop() == 0


def test_put_get_list_delete(proxy: Proxy) -> None:
    async def play() -> None:
        store = open_object_store(URL)
        await store.put("r/public/a.bin", b"0123456789")
        await store.put("r/public/a.bin", b"9876543210")
        assert await store.get("r/public/a.bin") == b"9876543210"
        assert await store.get_range("r/public/a.bin", 2, 3) == b"765"
        assert await store.get_range("r/public/a.bin", 8, 100) == b"10"
        assert await store.get("r/public/b.bin") is None
        for number in range(1100):
            await store.put(f"r/many/{number:04d}", b"")
        listed = [each.key async for part in store.list_objects("r/many") for each in part]
        assert sorted(listed) == [f"r/many/{number:04d}" for number in range(1100)]
        assert await store.list_folders("r") == ["many", "public"]
        await store.delete("r/public/a.bin")
        await store.delete("r/public/a.bin")
        assert await store.list_folders("r") == ["many"]
        with pytest.raises(ArchiveRefused, match="there is no such bucket"):
            await open_object_store("s3://absent/lab").put("a", b"")

    asyncio.run(play())
    assert proxy.requests > 1100


def test_a_day_in_its_life(start: Start, edges: Edges, bucket: Bucket) -> None:
    relay = start()
    model = Model({"robot.urdf": (b"<robot/>", "application/xml"), "meshes/a.glb": (b"glTF" * 99_999, "")})
    edge = edges(relay.zenoh, model=model)
    newest = await_segment(relay, edge, 3)
    manifest = bucket.folder / "r" / "models" / model.digest / "manifest.json"
    until("the model is there", lambda: manifest.is_file() or None, LONG_S)
    finish(relay, edge, bucket, newest, start)
    again = start()
    base = f"http://{again.address}/api/v1/robots/r/model/{model.digest}"
    served = httpx.get(f"{base}/meshes/a.glb", timeout=20)  # its edge is away
    assert served.content == b"glTF" * 99_999
    assert httpx.get(f"{base[:-1]}0/meshes/a.glb").status_code == 404
    said = run_past("list", "--past", URL)
    assert said.stdout.splitlines()[1].split()[-1] == str(len(list_there(bucket.folder))), said
    said = run_past("delete", "--past", URL, "--robot", "r", "--all", "--yes")
    assert said.returncode == 0, said
    until("nothing is left", lambda: not list_names(bucket.folder) or None)
    until("it is shown no more", lambda: not list_shown(again) or None)
    until("schema and model are gone", lambda: not [*bucket.folder.glob("r/*/*")] or None, LONG_S)


def test_a_store_that_takes_two_seconds_for_each_write(
    start: Start, edges: Edges, bucket: Bucket, proxy: Proxy
) -> None:
    relay = start()
    proxy.put_s = 2.0
    edge = edges(relay.zenoh)
    newest = record_more(relay, edge, 12)
    puts = proxy.puts
    until("it is written to all the while", lambda: proxy.puts > puts + 4 or None, LONG_S)
    assert get_why(relay) == ""
    proxy.put_s = 0.0
    finish(relay, edge, bucket, newest, start)


async def test_a_store_that_is_away_for_a_minute(
    start: Start, edges: Edges, bucket: Bucket, proxy: Proxy
) -> None:
    relay = start()
    edge = edges(relay.zenoh)
    await asyncio.to_thread(await_segment, relay, edge, 1)
    async with Watcher(relay.url()) as watcher:
        await watcher.until("a frame", lambda seen: seen.frames)
        since = watcher.frames[-1][1].seq
        proxy.close()
        end_s = time.monotonic() + AWAY_S
        while time.monotonic() < end_s:
            seen = len(watcher.frames)
            newest = await asyncio.to_thread(record_more, relay, edge, 1)
            await watcher.until("live goes on", lambda each, seen=seen: len(each.frames) > seen)  # type: ignore[misc]
        assert "the archive" in await asyncio.to_thread(get_why, relay)
        proxy.open()
        missed = watcher.most_missed(since)
        hz = edge.hz
    assert missed < 5 * hz  # this machine may be busy; the store was away for twelve times as long
    newest = await asyncio.to_thread(record_more, relay, edge, 1)
    await asyncio.to_thread(finish, relay, edge, bucket, newest, start)
    assert "nothing was lost" in relay.errors()


def test_keys_that_are_wrong_for_a_while(start: Start, edges: Edges, bucket: Bucket, s3: S3Server) -> None:
    s3.kill()
    s3.start(secret="another")
    refuse_and_mend(start, edges, bucket, s3, "access denied: check its keys", s3.restart)


def test_a_bucket_that_is_gone_for_a_while(start: Start, edges: Edges, bucket: Bucket, s3: S3Server) -> None:
    own = s3.folder / BUCKET
    own.rename(s3.folder.parent / "aside")
    refuse_and_mend(
        *(start, edges, bucket, s3, "there is no such bucket"),
        lambda: (s3.folder.parent / "aside").rename(own),
    )


def test_a_store_that_can_only_be_read_for_a_while(
    start: Start, edges: Edges, bucket: Bucket, s3: S3Server
) -> None:
    s3.kill()
    s3.start("--readonly")
    refuse_and_mend(start, edges, bucket, s3, "access denied: check its keys", s3.restart)


@pytest.fixture
def small_disk(s3: S3Server) -> Iterator[Path]:
    """The server's folder on a disk of 200 kB."""
    s3.kill()
    folder = s3.folder.parent / "small"
    folder.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=200k", "tmpfs", str(folder)], check=False)
    if mounted.returncode:
        pytest.skip("no tmpfs can be mounted here")
    shutil.copytree(s3.folder, folder, dirs_exist_ok=True)
    s3.folder = folder
    s3.start()
    yield folder
    s3.kill()
    subprocess.run(["umount", str(folder)], check=True)


def test_a_disk_that_is_full_for_a_while(small_disk: Path, start: Start, edges: Edges, s3: S3Server) -> None:
    filler = small_disk / "filler"
    filler.write_bytes(b"x" * 180_000)
    refuse_and_mend(start, edges, Bucket(s3), s3, "", filler.unlink)


def refuse_and_mend(
    start: Start, edges: Edges, bucket: Bucket, server: S3Server, why: str, mend: Callable[[], object]
) -> None:
    """A store that says no: live goes on, one line says why; once it is mended all is there."""
    relay = start()
    edge = edges(relay.zenoh)
    newest = await_segment(relay, edge, 4)
    until("it is said", lambda: get_why(relay).startswith("the past: the archive: ") or None, LONG_S)
    assert why in get_why(relay)
    address = f"http://{relay.address}/api/v1/robots/r/past/public/{newest['take']}/{newest['index']}"
    assert httpx.get(address).is_success
    assert relay.errors().count("queueing up to") == 1
    assert server.process is not None
    mend()
    newest = record_more(relay, edge, 1)
    finish(relay, edge, bucket, newest, start)
    assert "nothing was lost" in relay.errors()


def test_another_writer_at_the_same_prefix_and_files_that_are_not_ours(
    start: Start, edges: Edges, bucket: Bucket
) -> None:
    first, second = start(), start()
    (bucket.folder / "r").mkdir(parents=True, exist_ok=True)
    foreign = [bucket.folder / path for path in ("notes.txt", "r/notes.txt", "r/public.txt")]
    for path in foreign:
        path.write_text("mine")
    edge = edges(first.zenoh, also=[second.zenoh])
    newest = [await_segment(relay, edge, 3) for relay in (first, second)]
    assert newest[0]["take"] != newest[1]["take"]
    for each in newest:
        take = int(each["take"], 16)
        until("both are there", lambda take=take, each=each: bucket.has(take, each["index"]) or None, LONG_S)  # type: ignore[misc]
    assert second.stop() == 0
    finish(first, edge, bucket, newest[0], start)
    assert all(path.read_text() == "mine" for path in foreign)


def test_kill_nine_at_any_moment_of_a_write(start: Start, edges: Edges, bucket: Bucket, proxy: Proxy) -> None:
    draw = random.Random(3)
    proxy.put_s = 0.3  # so that many moments lie within a write
    for _ in range(8):
        relay = start()
        edge = edges(relay.zenoh)
        newest = await_segment(relay, edge, 1)
        puts, at_s = proxy.puts, draw.uniform(0.0, 0.6)
        edge.force_key = True
        until("a write begins", lambda puts=puts: proxy.puts > puts or None, LONG_S)  # type: ignore[misc]
        end_s = time.monotonic() + at_s
        while time.monotonic() < end_s:
            edge.force_key = True
            time.sleep(0.01)
        relay.stop(signal.SIGKILL)
        edge.silent = True
        check_readable(bucket.folder)
        assert int(newest["take"], 16) in {take for take, _ in list_there(bucket.folder)}
    proxy.put_s = 0.0
    again = start()
    until("all is shown", lambda: list_shown(again) == set(list_there(bucket.folder)) or None, LONG_S)
    until("all is indexed", lambda: bucket.is_indexed() or None, LONG_S)
    files = [path for path in bucket.folder.rglob("*") if path.is_file() and path.suffix == ".segment"]
    assert all(read_segment_key(path.relative_to(bucket.folder).as_posix()) for path in files)


def test_a_deletion_that_is_killed_in_the_middle(start: Start, edges: Edges, bucket: Bucket) -> None:
    relay = start()
    edge = edges(relay.zenoh)
    newest = await_segment(relay, edge, 8)
    finish(relay, edge, bucket, newest, start)
    count = len(list_there(bucket.folder))
    store = ("--past", URL, "--robot", "r", "--all", "--yes")
    command = subprocess.Popen([sys.executable, "-m", "posecast_relay.cli", "past", "delete", *store])
    until("it has begun", lambda: len(list_names(bucket.folder)) < count or None, LONG_S)
    command.kill()
    command.wait()
    start()
    until("the next start finishes it", lambda: not list_names(bucket.folder) or None, LONG_S)
