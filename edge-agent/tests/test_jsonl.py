from __future__ import annotations

import contextlib
import json
import logging
import math
import os
import select
import threading
import time
from pathlib import Path

import pytest
from cost_stage import cost, grows_linearly
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources import lines
from posecast_edge.sources.base import Troubled
from posecast_edge.sources.clock import UNITS_OF_TIME, guess_time_unit
from posecast_edge.sources.jsonl import parse_line
from posecast_edge.sources.lines import MAX_LINE, LineError, LineSource, LineSplitter
from posecast_edge.sources.registry import KINDS, open_source
from posecast_testing import until


def test_a_line_becomes_a_sample() -> None:
    line = b'{"t": 12.5, "pos": {"RKN": 0.5}, "ref": [1, null], "info": {"mode": "walk", "n": 3}}'
    sample, wrong = parse_line(line, 99.0, "line 1")
    assert sample == Sample(
        12.5, {"pos": {"RKN": 0.5}, "ref": [1, None]}, {"mode": "walk", "n": "3"}, "line 1"
    )
    assert wrong == {}


def test_without_t_the_arrival_counts() -> None:
    assert parse_line(b'{"pos": [1]}', 99.5)[0].t_s == 99.5


def test_nan_and_infinity_are_no_reading() -> None:
    sample, wrong = parse_line(b'{"pos": [NaN, Infinity, -Infinity, 1.0]}', 0.0)
    assert (sample.values["pos"], wrong) == ([None, None, None, 1.0], {})


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (b"nonsense", "not JSON"),
        (b'{"pos": [1', "not JSON"),
        (b"\xff\xfe{}", "not"),
        (b"[1, 2]", "not a JSON object"),
        (b"{}", "no field"),
        (b'{"t": 1}', "no field"),
        (b'{"pos": 1}', "pos is 1, not a list or an object"),
        (b'{"pos": "x"}', 'pos is "x", not a list'),
        (b'{"info": 3}', "info is not an object"),
        (b'{"info": {"a": [1]}}', "info.a is not a text"),
        (b"[" * 20000, "nested too deep"),
        (b'{"pos": ' + b"[" * 500_000, "nested too deep"),
        (b'{"pos": [1]}\0', "not JSON: Extra data at character 13"),
        (b"\xed\xa0\x80", "not UTF-8"),  # half a character, as some encoders write it
    ],
)
def test_a_bad_line_says_why(line: bytes, reason: str) -> None:
    with pytest.raises(LineError, match=r".") as caught:
        parse_line(line, 0.0)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("line", "values", "info", "wrong"),
    [
        (b'{"pos": [1], "ref": 2, "vel": "x"}', {"pos": [1]}, {}, ["ref is 2,", 'vel is "x",']),
        (b'{"pos": [1], "vel": null}', {"pos": [1]}, {}, []),
        (b'{"pos": [1], "info": 3}', {"pos": [1]}, {}, ["info is not an object"]),
        (b'{"pos": [1], "info": {"a": [1], "b": "c"}}', {"pos": [1]}, {"b": "c"}, ["info.a is not a text"]),
        (b'{"pos": [1], "\\u202ebad": 1}', {"pos": [1]}, {}, ["\\u202ebad is 1,"]),
        (b'{"pos": [1], "pos": [2]}', {"pos": [2]}, {}, []),  # of a name that stands twice the last counts
        (b'\xef\xbb\xbf{"pos": [1]}', {"pos": [1]}, {}, []),
        (b'{"pos": [1e999, ' + b"9" * 5000 + b", 1]}", {"pos": [float("inf"), float("inf"), 1]}, {}, []),
        (b'{"info": {"n": ' + b"9" * 5000 + b"}}", {}, {"n": "inf"}, []),
        (b'{"t": -5.5, "pos": [5e-324]}', {"pos": [5e-324]}, {}, []),
    ],
)
def test_what_is_wrong_in_a_line_is_named_and_the_rest_counts(
    line: bytes, values: dict[str, object], info: dict[str, str], wrong: list[str]
) -> None:
    sample, said = parse_line(line, 0.0)
    assert (sample.values, sample.info) == (values, info)
    assert len(said) == len(wrong)
    assert all(text.startswith(start) for text, start in zip(said.values(), wrong, strict=True)), said


NO_TIME = "not a number of seconds; the time of arrival counts"


@pytest.mark.parametrize(
    ("t", "line"),
    [
        ('"1"', f't is "1", {NO_TIME}'),
        ("NaN", f"t is null, {NO_TIME}"),
        ("1e999", f"t is Infinity, {NO_TIME}"),
        ("true", f"t is true, {NO_TIME}"),
        ("1" + "0" * 400, f"t is 1{'0' * 38}…, {NO_TIME}"),
        ("[" * 300 + "]" * 300, f"t is {'[' * 39}…, {NO_TIME}"),
        ("1e20", f"t is 1e+20, {NO_TIME}"),
    ],
)
def test_a_time_that_is_none_costs_the_time_only(t: str, line: str) -> None:
    sample, wrong = parse_line(b'{"t": ' + t.encode() + b', "pos": [1]}', 99.5)
    assert (sample.t_s, sample.values) == (99.5, {"pos": [1]})
    assert list(wrong) == ["t"]
    assert wrong["t"].startswith(line)


SMALLER = {"seconds": 1.0, "milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}
SINCE_1970_S = 1_795_899_884.25
LATER_S = 12.5


@pytest.mark.parametrize("unit", SMALLER)
def test_a_time_since_1970_shows_its_unit(unit: str) -> None:
    for sign in (1, -1):
        t = int(sign * SINCE_1970_S * SMALLER[unit])
        sample, wrong = parse_line(b'{"t": %d, "pos": {"a": 1}}' % t, 99.5)
        assert sample.t_s == pytest.approx(sign * SINCE_1970_S, abs=1)
        said = f"t is read as {unit}, because it starts at {t:.4g}"
        assert wrong == ({} if unit == "seconds" else {"unit of t": said})


@pytest.mark.parametrize("unit", SMALLER)
@pytest.mark.parametrize("step_s", [0.01, 0.05, 1.0])
@pytest.mark.parametrize("began_s", [0.0, LATER_S, SINCE_1970_S])
def test_the_clock_of_a_file_shows_its_unit(
    unit: str, step_s: float, began_s: float, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A program may write its lines in any unit; what can't be read in the first lines costs nothing."""
    path = tmp_path / "log.jsonl"
    times = [(began_s + k * step_s) * SMALLER[unit] for k in range(5)]
    lines = [json.dumps({"t": t, "pos": {"a": k}}) for k, t in enumerate(times)]
    path.write_text("\n".join(["no json", '{"t": "x", "pos": {"a": 0}}', *lines]))
    source = open_source(f"jsonl:{path}", None)
    assert isinstance(source, LineSource)
    samples: list[Sample] = []
    stop = threading.Event()

    def deliver(sample: Sample) -> None:
        samples.append(sample)
        if len(samples) == 3:
            stop.set()

    source.run(deliver, stop)
    assert [s.t_s for s in samples[1:]] == pytest.approx([began_s, began_s + step_s])
    said = [line for line in caplog.messages if "t is read as" in line]
    if unit == "seconds":
        assert said == []
    else:
        assert len(said) == 1
        assert said[0].startswith(f"{path}: t is read as {unit}, because it")


@pytest.mark.parametrize("unit", ["milliseconds", "microseconds", "nanoseconds"])
@pytest.mark.parametrize("first", [0, 1])
def test_of_two_clocks_the_one_since_1970_shows_the_unit(unit: str, first: int) -> None:
    times = [
        (SINCE_1970_S, 5000.0)[(k + first) % 2] * SMALLER[unit] + k * SMALLER[unit] / 50 for k in range(40)
    ]
    assert UNITS_OF_TIME[guess_time_unit(times, "lines")[0]][1] == unit


def test_a_file_whose_clock_steps_back_says_so_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "a.jsonl"
    path.write_text("".join(f'{{"t": {t}, "pos": {{"a": 1}}}}\n' for t in (0, 0.01, 0, 0.01, 0)))
    source = open_source(f"jsonl:{path}", None)
    source.run(lambda _: None, threading.Event())
    assert caplog.messages == [
        f"{path}: its clock steps back from 0.010 s to 0.000 s; the order in the file counts"
    ]


def test_the_clock_of_a_pipe_is_compared_with_ours(caplog: pytest.LogCaptureFixture) -> None:
    line = b'{"t": %d, "pos": {"a": 1}}\n'
    run_bytes(line % 100 + line % 50 + line % 1_795_899_884_250 + line % 1_795_899_884_251)
    assert caplog.messages == [
        "stdin: t stepped back by more than a second: does it come from another clock?",
        "stdin: t is read as milliseconds, because it starts at 1.796e+12",
    ]


def test_a_sensor_is_a_list_as_in_python() -> None:
    line = b'{"gyro": {"imu": [1, 2, null], "leg": [1], "arm.x": 4}, "pos": {"a": [1, 2, 3]}}'
    sample, wrong = parse_line(line, 0.0)
    assert sample.values == {
        "gyro": {"imu.x": 1, "imu.y": 2, "imu.z": None, "arm.x": 4},
        "pos": {"a": [1, 2, 3]},
    }
    assert wrong == {"gyro.leg": "gyro of 'leg': give 3 numbers, x, y, z"}


def test_each_bad_part_is_named_once_and_the_rest_is_counted(caplog: pytest.LogCaptureFixture) -> None:
    line = b'{"pos": {"a": 1}, "t": "x", "ok": true, "n": %d, "info": {"k": [1], "m": "x"}}\n'
    line += b'{"s": "x", "q": 1}\n'
    with caplog.at_level(logging.WARNING):
        samples = run_bytes(b"".join(line % n for n in range(200)) + b'{"pos": {"a": 1}, "late": 1}\n')
    assert len(samples) == 201
    assert caplog.messages[:6] == [
        f'stdin line 1: t is "x", {NO_TIME}',
        "stdin line 1: info.k is not a text",
        "stdin line 1: ok is true, not a list or an object",
        "stdin line 1: n is 0, not a list or an object",
        'stdin line 2: s is "x", not a list or an object',
        "stdin line 2: q is 1, not a list or an object",
    ]
    newest = "more bad lines, the newest: stdin line"
    counts = [text.partition(f" {newest}")[0] for text in caplog.messages[6:] if newest in text]
    assert counts == ["10", "100", "1000", "1194"]
    assert caplog.messages[-2] == "stdin line 401: late is 1, not a list or an object"
    assert len(caplog.messages) == 6 + 4 + 1


def test_more_texts_than_a_line_may_have() -> None:
    sample, wrong = parse_line(json.dumps({"info": {f"k{i}": "v" for i in range(100)}}).encode(), 0.0)
    assert list(sample.info) == [f"k{i}" for i in range(32)]
    assert list(wrong.values()) == ["info has 100 entries; at most 32"]


def test_a_message_about_a_line_is_one_short_line() -> None:
    with pytest.raises(LineError) as caught:
        parse_line(b'{"' + b"\\n" * 300_000 + b'": 1}', 0.0)
    assert len(str(caught.value)) < 200
    assert str(caught.value).isprintable()


def test_a_line_of_three_hundred_joints_in_full_precision() -> None:
    joints = {f"left_hand_finger_{i}_joint": 0.1234567890123456 + i for i in range(300)}
    line = json.dumps(dict.fromkeys(("ref", "pos", "vel", "cur", "temp"), joints)).encode()
    assert len(line) > 64 * 1024
    assert parse_line(line, 0.0)[0].values["temp"] == joints


def open_pipe(fd: int) -> LineSource:
    return LineSource("jsonl", fd, "stdin", parse_line, lambda _: math.nan)


class Read:
    """A source running in a thread, its samples in a list."""

    def __init__(self, source: LineSource) -> None:
        self.samples: list[tuple[float, Sample]] = []
        self.stop = threading.Event()
        self.thread = threading.Thread(
            target=source.run, args=(lambda s: self.samples.append((time.monotonic(), s)), self.stop)
        )
        self.thread.start()

    def join(self) -> None:
        self.thread.join(5)
        assert not self.thread.is_alive()


def run_bytes(data: bytes) -> list[Sample]:
    read, write = os.pipe()
    reader = Read(open_pipe(read))
    view = memoryview(data)
    while view:
        view = view[os.write(write, view) :]
    os.close(write)
    reader.join()
    os.close(read)
    return [s for _, s in reader.samples]


def test_the_rest_keeps_running_and_lines_are_numbered(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        samples = run_bytes(b'{"pos":[1]}\n\noops\n{"pos":[2]}\n' + b"x" * 3_000_000 + b'\n{"pos":[3]}')
    assert [(s.values["pos"], s.where) for s in samples] == [
        ([1], "stdin line 1"),
        ([2], "stdin line 4"),
        ([3], "stdin line 6"),
    ]
    assert caplog.messages[0].startswith("stdin line 3: not JSON")
    assert caplog.messages[1:] == ["stdin line 5: longer than 1048576 bytes; it is dropped"]


def test_lines_that_are_too_long_are_told_to_viewers() -> None:
    read, write = os.pipe()
    os.set_blocking(write, True)
    source = open_pipe(read)
    reader = Read(source)
    os.write(write, b'{"pos": [1]}\n')
    until("a sample", lambda: len(reader.samples) == 1)
    assert source.trouble == ""
    view = memoryview(b"[" * (MAX_LINE + 1) + b"\n")
    while view:
        view = view[os.write(write, view) :]
    until("what viewers read", lambda: source.trouble == "robot's samples are too large")
    assert isinstance(source, Troubled)
    os.close(write)
    reader.join()
    os.close(read)


def test_a_line_without_an_end_holds_little_memory() -> None:
    assert run_bytes(b"x" * 3_000_000) == []


def test_stop_ends_a_reader_that_waits() -> None:
    read, write = os.pipe()
    reader = Read(open_pipe(read))
    reader.stop.set()
    reader.join()
    os.close(read)
    os.close(write)


def test_a_file_plays_at_the_pace_of_its_clock(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    times = [100.0, 100.1, 100.2, 5000.0, 5000.1]  # a jump is not waited for
    path.write_text("".join(json.dumps({"t": t, "pos": [t]}) + "\n" for t in times))
    source = open_source(f"jsonl:{path}", None)
    assert isinstance(source, LineSource)
    reader = Read(source)
    reader.join()
    assert [s.t_s for _, s in reader.samples] == times
    took_s = reader.samples[-1][0] - reader.samples[0][0]
    assert 0.28 < took_s < 1000, "but for the jump"


def test_a_fifo_outlives_its_writer(tmp_path: Path) -> None:
    path = tmp_path / "fifo"
    os.mkfifo(path)
    source = open_source(f"jsonl:{path}", None)
    assert isinstance(source, LineSource)
    reader = Read(source)
    for n in (1, 2):
        path.write_text(json.dumps({"pos": [n]}) + "\n")
        until(f"sample {n}", lambda n=n: len(reader.samples) == n)  # type: ignore[misc]
    assert reader.thread.is_alive()
    reader.stop.set()
    reader.join()


def test_a_path_that_is_not_there() -> None:
    with pytest.raises(SourceError, match=r"^/nowhere/x: No such file"):
        open_source("jsonl:/nowhere/x", None)


def test_unknown_kind() -> None:
    with pytest.raises(
        SourceError, match=rf"^unknown source 'ros' \(did you mean ros2\?\): one of {', '.join(KINDS)}$"
    ):
        open_source("ros", None)


def test_of_lines_that_come_together_the_last_is_the_newest() -> None:
    lines = b"".join(b'{"pos":[%d]}\n' % n for n in range(5))
    samples = run_bytes(lines + b"oops\n\n")
    assert [(s.values["pos"], s.newest) for s in samples] == [
        ([0], False),
        ([1], False),
        ([2], False),
        ([3], False),
        ([4], True),
    ]


class Clock:
    """Runs, and can be put forward."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.ahead_s = 0.0
        monkeypatch.setattr("posecast_edge.kit.now_s", lambda: time.monotonic() + self.ahead_s)


def test_after_a_stall_what_lay_in_the_pipe_is_not_the_newest(monkeypatch: pytest.MonkeyPatch) -> None:
    """The reader is stopped for 10 s (SIGSTOP), the writer blocks in the full pipe and then goes on."""
    clock = Clock(monkeypatch)
    monkeypatch.setattr(lines, "QUIET_S", 1.0)  # for a machine that is slow to wake the writer
    read, write = os.pipe()
    got: list[Sample] = []
    stopped, blocked, goes_on, stop = (threading.Event() for _ in range(4))

    def deliver(sample: Sample) -> None:
        got.append(sample)
        if len(got) == 3:
            stopped.set()
            goes_on.wait()

    written = [0]

    def feed() -> None:
        while not stop.wait(0.002):
            written[0] += 1
            if not select.select([], [write], [], 0)[1]:
                blocked.set()
            with contextlib.suppress(OSError):
                os.write(write, b'{"pos":[%d]}%s\n' % (written[0], b" " * 4000))

    reader = threading.Thread(target=open_pipe(read).run, args=(deliver, stop))
    writer = threading.Thread(target=feed)
    reader.start()
    writer.start()
    stopped.wait()
    blocked.wait()
    clock.ahead_s = 10.0
    before, old = len(got), written[0]
    goes_on.set()
    until("the newest", lambda: any(s.newest for s in got[before:]))
    stop.set()
    os.set_blocking(write, False)
    reader.join(5)
    writer.join(5)
    os.close(read)
    os.close(write)
    first = next(s for s in got[before:] if s.newest)
    [n] = first.values["pos"]
    assert isinstance(n, int)
    assert n > old, "what the writer was held up with is old as well"
    numbers = [s.values["pos"][0] for s in got]  # type: ignore[index]
    assert numbers == list(range(1, len(numbers) + 1)), "all are looked at for faults"


@pytest.mark.parametrize("kind", ["no end", "empty lines", "bad lines", "one long line", "in single bytes"])
def test_lines_cost_what_they_are_long(kind: str) -> None:
    """The splitter's steps grow no faster than its input, however it comes."""

    def steps(n: int) -> int:
        data = {
            "no end": b"x" * n,
            "empty lines": b"\n" * n,
            "bad lines": b"oops\n" * (n // 5),
            "one long line": b'{"pos":[' + b"1," * (n // 2) + b"1]}\n",
            "in single bytes": b"x" * (n - 1) + b"\n",
        }[kind]
        size = 1 if kind == "in single bytes" else 4096
        chunks = [data[i : i + size] for i in range(0, len(data), size)]
        splitter = LineSplitter(MAX_LINE)
        return cost(lambda: [parsed(line) for chunk in chunks for line in splitter.feed(chunk)])

    def parsed(line: bytes) -> bool:
        with contextlib.suppress(LineError):
            return bool(parse_line(line, 0.0))
        return False

    assert grows_linearly(steps, 1000)
