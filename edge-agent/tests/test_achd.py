"""Frames through achd: the protocol byte for byte, and everything that goes wrong with it."""

from __future__ import annotations

import logging
import random
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest
from achd_stage import Achd, framed, refuse
from posecast_edge.kit import Backoff
from posecast_edge.sources.hubo import achd as achd_module
from posecast_edge.sources.hubo.achd import (
    BATCH_BYTES,
    AchdParser,
    AchdProtocolError,
    AchdReader,
    BatchTimer,
    make_request,
)
from posecast_edge.sources.hubo.reconnecting import KEPT_MAX
from posecast_testing import free_port, until

OK = b"frame-count: 10\nframe-size: 3000\nstatus: 0 # ACH_OK\n.\n"


def test_the_request_asks_to_be_sent_to_and_never_to_write() -> None:
    assert make_request("hubo-state") == (
        b"channel-name: hubo-state\ntransport: tcp\nget-last: 1\ndirection: push\n.\n"
    )


def test_every_frame_comes_out_once_however_the_bytes_are_cut() -> None:
    stream = OK + framed(b"one") + framed(b"two") + framed(b"three") + framed(b"rest")[:18]
    whole = AchdParser()
    assert whole.feed(stream) == [b"one", b"two", b"three"]
    assert whole.pending == 18
    assert whole.feed(framed(b"rest")[18:] + framed(b"more")[:3]) == [b"rest"]
    assert whole.feed(framed(b"more")[3:]) == [b"more"]
    assert whole.pending == 0
    for step in (1, 2, 7, 16, 17):
        cut = AchdParser()
        got = [f for i in range(0, len(stream), step) for f in cut.feed(stream[i : i + step])]
        assert got == [b"one", b"two", b"three"], step


def test_of_more_frames_at_once_than_anybody_looks_at_the_newest_come_out() -> None:
    c = AchdParser()
    got = c.feed(OK + b"".join(framed(b"%d" % k) for k in range(KEPT_MAX + 40)))
    assert got == [b"%d" % k for k in range(40, KEPT_MAX + 40)]
    assert c.feed(framed(b"next")) == [b"next"]


def test_a_header_may_be_written_in_other_ways() -> None:
    c = AchdParser()
    assert c.feed(b"# achd\n\nStatus = 0\nmessage: all: well\n.\n" + framed(b"x")) == [b"x"]


@pytest.mark.parametrize(
    ("said", "message"),
    [
        (
            b"status: 9 # ACH_ENOENT\nmessage: Couldn't open channel hubo-state\n.\n",
            "Couldn't open channel hubo-state (ACH_ENOENT)",
        ),
        (b"status: 15\n.\n", "ACH_EACCES"),
        (b"status: 99\n.\n", "status 99"),
        (b"frame-count: 10\n.\n", "a header without a status: this is not achd"),
        (b"status: well\n.\n", "a header without a status: this is not achd"),
        (b"HTTP/1.1 400 Bad Request\r\n", "this is not achd"),
        (b"SSH-2.0-OpenSSH\n", "header line SSH-2.0-OpenSSH has no key and value: this is not achd"),
        (b"\xff\xfe\n", "a header that is not text: this is not achd"),
        (b"a" * 1024, "a header line of over 1024 bytes: this is not achd"),
        (b"a: b\n" * 65, "a header of over 64 lines: this is not achd"),
        (OK + b"achpope\0" + bytes(8), "no frame where one should begin: the stream is out of sync"),
        (OK + b"achpipe\0" + struct.pack("<Q", 0), "a frame of 0 bytes"),
        (OK + b"achpipe\0" + struct.pack("<Q", 65537), "a frame of 65537 bytes; at most 65536"),
        (OK + b"achpipe\0" + b"\xff" * 8, "a frame of 18446744073709551615 bytes"),
        (b"status: 9\nmessage: bell \x07\n.\n", "bell � (ACH_ENOENT)"),
    ],
)
def test_what_is_no_frame_is_said_in_one_line(said: bytes, message: str) -> None:
    def talk(step: int) -> None:
        c = AchdParser()
        for i in range(0, len(said), step):
            c.feed(said[i : i + step])

    for step in (1, len(said)):
        with pytest.raises(AchdProtocolError) as caught:
            talk(step)
        assert message in str(caught.value)
        assert str(caught.value).isprintable()


def test_backoff_doubles_and_forgets_after_a_good_connection() -> None:
    b = Backoff()
    waits = []
    now_s = 0.0
    for _ in range(7):
        assert b.is_due(now_s)
        b.record_success(now_s)
        b.record_failure(now_s)
        waits.append(next(x / 10 for x in range(1, 100) if b.is_due(now_s + x / 10)))
        now_s += waits[-1]
    assert waits == [0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0]
    b.record_success(now_s)
    b.record_failure(now_s + 5)
    assert b.is_due(now_s + 5.2)


class Reading:
    """A reader in a thread of its own; what it gets."""

    def __init__(self, port: int) -> None:
        self.frames: list[bytes] = []
        self._stop = threading.Event()
        self.reader = AchdReader("127.0.0.1", port, "hubo-state")
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.is_set():
            self.frames += self.reader.wait_for_frames(self._stop, 0.0)
        self.reader.close()

    def end(self) -> None:
        self._stop.set()
        self._thread.join()


@pytest.fixture
def reading() -> Iterator[Callable[[int], Reading]]:
    made: list[Reading] = []

    def start(port: int) -> Reading:
        made.append(Reading(port))
        return made[-1]

    yield start
    for r in made:
        r.end()


def publish_until(server: Achd, frame: bytes, condition: Callable[[], bool], what: str) -> None:
    def step() -> bool:
        server.publish(frame)
        return condition()

    until(what, step)


def test_frames_come_and_a_broken_connection_comes_back(
    server: Achd, reading: Callable[[int], Reading], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    r = reading(server.port)
    publish_until(server, b"first", lambda: b"first" in r.frames, "the first frame")
    assert server.headers == [
        {"channel-name": "hubo-state", "transport": "tcp", "get-last": "1", "direction": "push"}
    ]
    server.drop_clients()
    publish_until(server, b"second", lambda: b"second" in r.frames, "a frame after the break")
    assert {h["direction"] for h in server.headers} == {"push"}
    assert caplog.messages == [
        f"127.0.0.1:{server.port}: the server closed the connection; still trying",
        f"127.0.0.1:{server.port}: receiving frames again",
    ]


def test_a_robot_that_is_switched_on_later_is_waited_for(
    reading: Callable[[int], Reading], caplog: pytest.LogCaptureFixture
) -> None:
    port = free_port()
    r = reading(port)
    until("told that nobody is there", lambda: "Connection refused; still trying" in caplog.text)
    server = Achd(port=port)
    try:
        publish_until(server, b"x", lambda: bool(r.frames), "a frame")
    finally:
        server.stop()


def test_a_channel_that_is_not_there_yet_is_told_once_and_waited_for(
    server: Achd, reading: Callable[[int], Reading], caplog: pytest.LogCaptureFixture
) -> None:
    server.instead = refuse
    r = reading(server.port)
    until("three tries", lambda: server.connections >= 3)
    server.instead = None
    publish_until(server, b"x", lambda: bool(r.frames), "a frame")
    told = [m for m in caplog.messages if "ENOENT" in m]
    assert told == [f"127.0.0.1:{server.port}: Couldn't open channel hubo-state (ACH_ENOENT); still trying"]


def test_a_server_that_says_nothing_or_nothing_more_is_left(
    server: Achd,
    reading: Callable[[int], Reading],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr(achd_module, "ANSWER_S", 0.3)
    monkeypatch.setattr(achd_module, "SILENT_S", 0.3)
    monkeypatch.setattr("posecast_edge.sources.hubo.reconnecting.SAY_EVERY_S", 0.0)
    done = threading.Event()

    def mute(client: socket.socket, header: dict[str, str]) -> None:
        done.wait(10)

    def one_frame(client: socket.socket, header: dict[str, str]) -> None:
        client.sendall(OK + framed(b"only"))
        done.wait(10)

    server.instead = mute
    r = reading(server.port)
    until("left a mute server", lambda: server.connections >= 2)
    server.instead = one_frame
    until("left a server whose channel was made anew", lambda: len(r.frames) >= 2)
    done.set()
    assert "no answer within 0.3 s" in caplog.text
    assert "no frame for 0.3 s" in caplog.text


def test_a_reader_that_was_away_gets_the_newest_and_no_backlog(server: Achd) -> None:
    """Kernel buffers hold hundreds of frames; all are taken, one counts."""
    reader = AchdReader("127.0.0.1", server.port, "hubo-state")
    never = threading.Event()
    connected = threading.Event()

    def all_at_once(client: socket.socket, header: dict[str, str]) -> None:
        client.sendall(OK + b"".join(framed(struct.pack("<I", i) * 900) for i in range(40)))
        connected.set()
        client.recv(1)  # until the reader goes

    server.instead = all_at_once
    got: list[bytes] = []
    while not got or got[-1][:4] != struct.pack("<I", 39):
        frames = reader.wait_for_frames(never, 0.0)
        connected.wait(10)
        time.sleep(0)
        if frames:
            got.append(frames[-1])
    assert len(got) <= 4, "frames were queued"
    reader.close()


def test_a_flood_does_not_keep_the_newest_frame_from_coming_out(server: Achd) -> None:
    over = threading.Event()

    def flood(client: socket.socket, header: dict[str, str]) -> None:
        client.sendall(OK)
        block = b"".join(framed(bytes([i]) * 1000) for i in range(64))
        while not over.is_set():
            client.sendall(block)

    server.instead = flood
    reader = AchdReader("127.0.0.1", server.port, "hubo-state")
    never = threading.Event()
    got = [0]

    def read() -> bool:
        got[0] += bool(reader.wait_for_frames(never, 0.0))
        return got[0] > 100

    try:
        until("frames of a flood that goes on", read, 60)
    finally:
        over.set()
        reader.close()


def test_of_a_fast_source_the_frames_until_the_wanted_one_wake_the_reader_once_and_none_is_lost(
    server: Achd,
) -> None:
    """200 frames a second, one wanted every 30 ms: some six at a time, the last of them as it comes. achd
    gathers small writes, so the kernel must go on acknowledging what nobody reads. Then the source slows
    down."""
    reader = AchdReader("127.0.0.1", server.port, "hubo-state")
    never = threading.Event()
    slow = threading.Event()
    over = threading.Event()

    def frames(client: socket.socket, header: dict[str, str]) -> None:
        client.sendall(OK)
        k = 0
        while not over.wait(0.1 if slow.is_set() else 0.005):
            client.sendall(framed(struct.pack("<Id", k, time.monotonic()).ljust(3898, b"x")))
            k += 1

    server.instead = frames
    got: list[int] = []
    ages_s: list[float] = []

    def read(in_s: float) -> int:
        """How many frames came at once."""
        came = reader.wait_for_frames(never, time.monotonic() + in_s)
        got.extend(struct.unpack_from("<I", frame)[0] for frame in came)
        if len(came) >= 4:
            ages_s.append(time.monotonic() - struct.unpack_from("<d", came[-1], 4)[0])
        return len(came)

    until("several at once", lambda: read(0.0275) >= 4 and len(ages_s) > 20, 30)
    until("one whose last has not waited, too", lambda: read(0.0275) > 0 and min(ages_s) < 0.004, 30)
    slow.set()
    n = len(got)
    until("one at a time", lambda: read(0.0275) == 1 and len(got) > n + 6, 30)
    over.set()
    reader.close()
    assert got == list(range(len(got)))


def ages(
    timer: BatchTimer, arrivals_s: list[float], hz: float, late_s: float = 0.03
) -> tuple[list[float], int]:
    """A reader that sleeps through batches, 30 wishes a second: ages (s) of what it gets, and its wakes."""
    found: list[float] = []
    at = wakes = 0
    now_s = arrivals_s[0]
    wanted_s = now_s
    while at < len(arrivals_s):
        batch = timer.compute_batch(wanted_s)
        last = at + batch - 1
        due_s = arrivals_s[last] if last < len(arrivals_s) else float("inf")
        if batch > 1 and due_s > (limit_s := max(now_s, timer.predict_due_s(batch) + late_s)):
            timer.reset()
            due_s = limit_s
        if due_s == float("inf"):
            break
        now_s = max(now_s, due_s)
        came = sum(1 for a in arrivals_s[at:] if a <= now_s)
        wakes += 1
        at += came
        if came:
            timer.record_batch(came, now_s)
            if now_s >= wanted_s:
                found.append(now_s - arrivals_s[at - 1])
                wanted_s = max(wanted_s + 1 / hz, now_s)
    return found, wakes


@pytest.mark.parametrize("source_hz", [1, 10, 29, 30, 31, 60, 100, 200, 333, 500])
def test_a_rhythm_wakes_for_the_frame_that_is_wanted(source_hz: float) -> None:
    dice = random.Random(1)
    seconds = 20
    arrivals_s = sorted(k / source_hz + dice.uniform(0, 0.0005) for k in range(round(seconds * source_hz)))
    found, wakes = ages(BatchTimer(), arrivals_s, 30.0)
    assert len(found) >= 0.85 * seconds * min(source_hz, 30) - 2
    assert max(found[:-1]) == 0, "each as it came; after the last nothing comes any more"
    assert wakes <= seconds * min(source_hz, 45) + 2


def test_a_rhythm_begins_anew_when_the_source_slows_down_or_pauses() -> None:
    arrivals_s = [k / 200 for k in range(400)]
    arrivals_s += [arrivals_s[-1] + 0.7 + k / 20 for k in range(40)]
    arrivals_s += [arrivals_s[-1] + k / 200 for k in range(1, 400)]
    found, wakes = ages(BatchTimer(), arrivals_s, 30.0)
    assert sum(age > 0 for age in found) <= 2, "only what was waited for in vain is not fresh"
    assert max(found) < 0.07
    assert wakes < 200


def test_a_batch_is_no_larger_than_what_the_kernel_keeps(server: Achd) -> None:
    """A thousand frames a second."""
    reader = AchdReader("127.0.0.1", server.port, "hubo-state")
    over = threading.Event()

    def frames(client: socket.socket, header: dict[str, str]) -> None:
        client.sendall(OK)
        while not over.wait(0.001):
            client.sendall(framed(bytes(3898)))

    server.instead = frames
    lows: list[int] = []

    def read() -> bool:
        reader.wait_for_frames(over, time.monotonic() + 1.0)
        lows.append(reader._low)
        return max(lows) > BATCH_BYTES // 2

    until("a large batch", read, 30)
    over.set()
    reader.close()
    assert max(lows) <= BATCH_BYTES


def test_noise_is_refused_or_waited_for_and_never_kept() -> None:
    dice = random.Random(1)
    for _ in range(300):
        c = AchdParser()
        with suppress(AchdProtocolError):
            if dice.random() < 0.5:
                c.feed(OK)
            for _ in range(50):
                assert c.feed(dice.randbytes(dice.randrange(1, 400))) == []
                assert len(c._buffer) < 1024 + 400
