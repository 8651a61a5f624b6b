"""A channel in shared memory, read beside a writer who knows nothing of it."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from ach_stage import HEADER, Writer, patterned
from posecast_edge.sources.hubo import ach_shm
from posecast_edge.sources.hubo.ach_shm import AchChannel, ChannelError, ShmReader
from posecast_testing import until


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "achshm-hubo-state"


def newest(channel: AchChannel) -> bytes | None:
    """The newest frame, where only that is asked for."""
    frames = channel.read_new_frames()
    return frames[-1] if frames else None


def test_the_newest_frame_once(path: Path) -> None:
    writer = Writer(path)
    channel = AchChannel(path)
    assert newest(channel) is None
    writer.put(b"one")
    assert newest(channel) == b"one"
    assert newest(channel) is None
    for i in range(25):  # around the ring, twice
        writer.put(bytes([i]) * 3898)
    assert newest(channel) == bytes([24]) * 3898
    assert newest(channel) is None
    assert channel.torn == 0


def test_all_that_is_there_comes_once_and_in_order(path: Path) -> None:
    writer = Writer(path)
    for i in range(3):
        writer.put(bytes([i]) * 3898)
    channel = AchChannel(path)
    assert channel.count_slots(3898) == 7
    assert channel.read_new_frames() == [bytes([2]) * 3898], "what was before us is not news"
    assert channel.read_new_frames() == []
    at = 3
    for count in (1, 7, 2, 6, 7, 7, 3):
        for i in range(at, at + count):
            writer.put(bytes([i]) * 3898)
        assert channel.read_new_frames() == [bytes([i]) * 3898 for i in range(at, at + count)]
        at += count
    for i in range(at, at + 30):
        writer.put(bytes([i]) * 3898)
    assert channel.read_new_frames() == [bytes([i]) * 3898 for i in range(at + 23, at + 30)], (
        "what it still keeps"
    )
    assert channel.seq == at + 30


def test_what_was_kept_comes_first_and_nothing_twice(path: Path) -> None:
    writer = Writer(path)
    channel = AchChannel(path)
    channel.save_frames()
    assert channel.read_new_frames() == []
    writer.put(bytes(3898))
    assert channel.read_new_frames() == [bytes(3898)]
    at = 1
    for batches in ((4, 3), (5, 5, 5), (7, 7), (0, 2), (2, 0)):
        for count in batches:
            channel.save_frames()  # before the next could overwrite what is there
            for i in range(at, at + count):
                writer.put(bytes([i]) * 3898)
            at += count
        came = sum(batches)
        assert channel.read_new_frames() == [bytes([i]) * 3898 for i in range(at - came, at)], batches
        assert channel.seq == at
    assert channel.torn == 0


def test_a_kept_frame_that_the_writer_crossed_is_left_out(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    size = 3896
    writer = Writer(path, frames=8, frame_size=size)
    writer.put(patterned(0, size))
    channel = AchChannel(path)
    channel.read_new_frames()
    for i in range(1, 8):
        writer.put(patterned(i, size))
    really = os.pread
    crossed: list[bytes] = []

    def slow(fd: int, count: int, place: int) -> bytes:
        if place < writer.data or crossed:
            return really(fd, count, place)
        half = really(fd, count // 2, place)
        for i in range(6):  # the place of 0, and over 1 to 5: half of it before the copy, half after
            writer.put(patterned(100 + i, size))
        crossed.append(half + really(fd, count - count // 2, place + count // 2))
        return crossed[0]

    monkeypatch.setattr("posecast_edge.sources.hubo.ach_shm.os.pread", slow)
    channel.save_frames()
    assert patterned(100 + 5, size) in crossed[0], "what was kept holds frames of a later time"
    for i in range(6, 12):
        writer.put(patterned(100 + i, size))
    assert channel.read_new_frames() == [patterned(i, size) for i in (6, 7, *range(104, 112))]


def test_a_large_channel_is_not_kept(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It keeps enough itself."""
    size = 3896
    writer = Writer(path, frames=200, frame_size=size)
    for i in range(3):
        writer.put(patterned(i, size))
    channel = AchChannel(path)
    channel.read_new_frames()
    writer.put(patterned(3, size))
    with monkeypatch.context() as m:
        m.setattr("posecast_edge.sources.hubo.ach_shm.os.pread", None)
        channel.save_frames()
    writer.put(patterned(4, size))
    assert channel.read_new_frames() == [patterned(3, size), patterned(4, size)]


def test_an_elder_frame_that_the_writer_crosses_is_left_out(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    size = 3896
    writer = Writer(path, frames=8, frame_size=size)
    writer.put(patterned(0, size))
    channel = AchChannel(path)
    assert channel.read_new_frames() == [patterned(0, size)]
    for i in range(1, 8):
        writer.put(patterned(i, size))
    really = os.pread
    crossings = iter([True])

    def slow(fd: int, count: int, place: int) -> bytes:
        data = really(fd, count, place)
        if place >= writer.data and next(crossings, False):
            for i in range(5):  # over the elder ones, when they have been read and not been checked
                writer.put(patterned(100 + i, size))
        return data

    with monkeypatch.context() as m:
        m.setattr("posecast_edge.sources.hubo.ach_shm.os.pread", slow)
        assert channel.read_new_frames() == [patterned(i, size) for i in (5, 6, 7)]
    assert channel.read_new_frames() == [patterned(100 + i, size) for i in range(5)]


def test_a_channel_begun_anew_in_its_place_is_followed(path: Path) -> None:
    writer = Writer(path)
    for i in range(30):
        writer.put(bytes([i]) * 100)
    channel = AchChannel(path)
    assert newest(channel) == bytes([29]) * 100
    Writer(path).put(b"first again")
    assert newest(channel) == b"first again"


def test_it_can_do_nothing_but_read(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[int] = []
    really = os.open

    def spy(name: Path, flags: int, *rest: int) -> int:
        opened.append(flags)
        return really(name, flags, *rest)

    monkeypatch.setattr("posecast_edge.sources.hubo.ach_shm.os.open", spy)
    writer = Writer(path)
    writer.put(b"x" * 3898)
    before = path.read_bytes()
    channel = AchChannel(path)
    newest(channel)
    assert path.read_bytes() == before, "not even the mutex has changed"
    assert [f & os.O_ACCMODE for f in opened] == [os.O_RDONLY]
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.pwrite(channel._fd, b"x", 0)


def test_a_frame_the_writer_crosses_is_read_again(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The writer laps the reader in the middle of its copy."""
    size = 3896
    writer = Writer(path, frames=3, frame_size=size)
    for i in range(3):
        writer.put(patterned(i, size))
    channel = AchChannel(path)
    really = os.pread
    crossings = iter([True, True])

    def slow(fd: int, count: int, place: int) -> bytes:
        if place >= writer.data and next(crossings, False):
            first = really(fd, count // 2, place)
            for i in range(3):
                writer.put(patterned(100 + i, size))
            return first + really(fd, count - count // 2, place + count // 2)
        return really(fd, count, place)

    monkeypatch.setattr("posecast_edge.sources.hubo.ach_shm.os.pread", slow)
    assert newest(channel) == patterned(102, size)
    assert channel.torn == 2


def test_frames_that_lie_far_apart_are_read_one_by_one(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Around the end of a large channel nobody copies all of it for two frames."""
    size = 3896
    writer = Writer(path, frames=200, frame_size=size)
    for i in range(199):
        writer.put(patterned(i, size))
    channel = AchChannel(path)
    channel.read_new_frames()
    for i in range(199, 202):
        writer.put(patterned(i, size))
    really = os.pread
    counts: list[int] = []

    def spy(fd: int, count: int, place: int) -> bytes:
        counts.append(count)
        return really(fd, count, place)

    monkeypatch.setattr("posecast_edge.sources.hubo.ach_shm.os.pread", spy)
    assert channel.read_new_frames() == [patterned(i, size) for i in (199, 200, 201)]
    assert counts[1:-1] == [size] * 3


def test_a_look_is_three_reads_however_many_frames_it_brings(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer = Writer(path)
    writer.put(b"x" * 3898)
    channel = AchChannel(path)
    channel.read_new_frames()
    really = os.pread
    reads = 0

    def spy(fd: int, count: int, place: int) -> bytes:
        nonlocal reads
        reads += 1
        return really(fd, count, place)

    monkeypatch.setattr("posecast_edge.sources.hubo.ach_shm.os.pread", spy)
    for count, expected in ((4, 3), (0, 1), (1, 3), (7, 3)):
        for _ in range(count):
            writer.put(b"x" * 3898)
        reads = 0
        assert len(channel.read_new_frames()) == count
        assert reads == expected
    reads = 0
    channel.save_frames()
    assert reads == 3


def test_a_writer_that_always_laps_us_is_given_up_for_now(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer = Writer(path, frames=3, frame_size=800)
    writer.put(patterned(1, 800))
    channel = AchChannel(path)
    really = os.pread
    puts = 0

    def lapped(fd: int, count: int, place: int) -> bytes:
        nonlocal puts
        if place >= writer.data:
            puts += 1
            for _ in range(3):
                writer.put(patterned(puts, 800))
        return really(fd, count, place)

    with monkeypatch.context() as m:
        m.setattr("posecast_edge.sources.hubo.ach_shm.os.pread", lapped)
        assert newest(channel) is None
    assert puts == ach_shm.TRIES
    assert newest(channel) == patterned(puts, 800)


def test_beside_a_real_writer_no_frame_is_torn(path: Path) -> None:
    """Another process writes as fast as it can into a channel of three frames."""
    size = 3896
    script = Path(__file__).with_name("ach_stage.py")
    with subprocess.Popen(
        [sys.executable, str(script), str(path), str(size)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as writer:
        assert writer.stdout is not None
        assert writer.stdin is not None
        assert writer.stdout.readline() == b"ready\n"
        channel = AchChannel(path)
        numbers: list[int] = []
        deadline = time.monotonic() + 60
        while len(numbers) < 500 and time.monotonic() < deadline:
            if len(numbers) % 2:
                channel.save_frames()
            for frame in channel.read_new_frames():
                number = int.from_bytes(frame[:8], "little")
                assert frame == patterned(number, size), "a torn frame came through"
                numbers.append(number)
        writer.stdin.close()
        written = int(writer.stdout.readline())
    assert len(numbers) >= 500
    assert numbers == sorted(set(numbers)), "never an older frame, never the same twice"
    assert written > 500


def damaged(path: Path, place: int, content: bytes) -> None:
    Writer(path).put(b"x" * 3898)
    with path.open("r+b") as f:
        f.seek(place)
        f.write(content)


COUNT, SIZE = 10, 3000
AFTER_INDEX = HEADER + 8 + 24 * COUNT


@pytest.mark.parametrize(
    ("place", "content", "message"),
    [
        (0, b"\x7fELF", "not an ACH channel: it begins with 0x464c457f"),
        (88, struct.pack("<Q", 0), "another layout: its counts are invalid"),
        (88, struct.pack("<Q", 1 << 40), "another layout: its counts are invalid"),
        (96, struct.pack("<Q", 1 << 60), "another layout: its counts are invalid"),
        (88, struct.pack("<Q", 11), "another layout: 30584 bytes where 30608 are expected"),
        (HEADER, bytes(8), "another layout: no guard at byte 320"),
        (AFTER_INDEX, bytes(8), f"another layout: no guard at byte {AFTER_INDEX}"),
        (AFTER_INDEX + 8 + COUNT * SIZE, bytes(8), "another layout: no guard at byte 30576"),
    ],
)
def test_another_layout_is_refused_in_one_line(path: Path, place: int, content: bytes, message: str) -> None:
    damaged(path, place, content)
    with pytest.raises(ChannelError) as caught:
        AchChannel(path)
    assert message in str(caught.value)


def test_a_stub_a_shrunk_file_and_an_index_that_points_outside(path: Path) -> None:
    path.write_bytes(b"\xf3\x11\x75\xb0")
    with pytest.raises(ChannelError, match="only 4 bytes"):
        AchChannel(path)
    damaged(path, HEADER + 8, struct.pack("<QQQ", 3898, 29_000, 1))
    with pytest.raises(ChannelError, match="its index points at byte 29000, 3898 long, of 30000"):
        AchChannel(path).read_new_frames()
    Writer(path).put(b"x" * 3898)
    channel = AchChannel(path)
    os.truncate(path, 200)
    with pytest.raises(ChannelError, match="shrunk"):
        newest(channel)


def test_the_reader_waits_for_a_channel_and_follows_a_new_one(
    path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    monkeypatch.setattr("posecast_edge.sources.hubo.reconnecting.SAY_EVERY_S", 0.0)
    frames: list[bytes] = []
    stop = threading.Event()
    reader = ShmReader(path)

    def run() -> None:
        while not stop.is_set():
            frames.extend(reader.wait_for_frames(stop, 0.0))

    thread = threading.Thread(target=run)
    thread.start()
    try:
        until("told that there is none", lambda: "No such file or directory; still trying" in caplog.text)
        made = path.with_name("made")
        Writer(made).put(b"first")
        made.rename(path)
        until("the first daemon's frame", lambda: b"first" in frames)
        Writer(made).put(b"second")
        made.rename(path)  # hubo-ach was restarted: the old file lives on under no name
        until("the second daemon's frame", lambda: b"second" in frames)
        assert "the channel was created again; still trying" in caplog.text
        path.write_bytes(b"rubbish")
        until("told of the rubbish", lambda: "shrunk" in caplog.text or "no ACH channel" in caplog.text)
        Writer(made).put(b"third")
        made.rename(path)
        until("the third daemon's frame", lambda: b"third" in frames)
    finally:
        stop.set()
        thread.join()
        reader.close()
