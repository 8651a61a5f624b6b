from __future__ import annotations

import json
import logging
import os
import threading
import time
from pathlib import Path

import pytest
from edge_stage import until
from posecast_edge.sources import KINDS, Sample, SourceError, open_source
from posecast_edge.sources.jsonl import MAX_LINE, JsonlSource, LineError, parse_line


def test_a_line_becomes_a_sample() -> None:
    line = b'{"t": 12.5, "pos": {"RKN": 0.5}, "ref": [1, null], "info": {"mode": "walk", "n": 3}}'
    sample = parse_line(line, 99.0, "line 1")
    assert sample == Sample(
        12.5, {"pos": {"RKN": 0.5}, "ref": [1, None]}, {"mode": "walk", "n": "3"}, "line 1"
    )


def test_without_t_the_arrival_counts() -> None:
    assert parse_line(b'{"pos": [1]}', 99.5).t_s == 99.5


def test_nan_and_infinity_are_no_reading() -> None:
    assert parse_line(b'{"pos": [NaN, Infinity, -Infinity, 1.0]}', 0.0).values["pos"] == [
        None,
        None,
        None,
        1.0,
    ]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (b"nonsense", "not JSON"),
        (b'{"pos": [1', "not JSON"),
        (b"\xff\xfe{}", "not"),
        (b"[1, 2]", "not a JSON object"),
        (b"{}", "no field"),
        (b'{"t": 1}', "no field"),
        (b'{"t": "1", "pos": [1]}', 't is "1", not a number'),
        (b'{"t": NaN, "pos": [1]}', "t is null"),
        (b'{"t": 1e999, "pos": [1]}', "t is Infinity"),
        (b'{"t": true, "pos": [1]}', "t is true"),
        (b'{"t": 1' + b"0" * 400 + b', "pos": [1]}', "t is 1000"),
        (b'{"pos": 1}', "pos is 1, not a list or an object"),
        (b'{"pos": "x"}', 'pos is "x", not a list'),
        (b'{"pos": [1], "info": 3}', "info is not an object"),
        (b'{"pos": [1], "info": {"a": [1]}}', "info.a is not a text"),
        (b"[" * 20000, "nested too deep"),
        (b" " * (MAX_LINE + 1), "over 65536 bytes"),
    ],
)
def test_a_bad_line_says_why(line: bytes, reason: str) -> None:
    with pytest.raises(LineError, match=r".") as caught:
        parse_line(line, 0.0)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


class Read:
    """A source running in a thread, its samples in a list."""

    def __init__(self, source: JsonlSource) -> None:
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
    reader = Read(JsonlSource(read, "stdin"))
    view = memoryview(data)
    while view:
        view = view[os.write(write, view) :]
    os.close(write)
    reader.join()
    os.close(read)
    return [s for _, s in reader.samples]


def test_the_rest_keeps_running_and_lines_are_numbered(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        samples = run_bytes(b'{"pos":[1]}\n\noops\n{"pos":[2]}\n' + b"x" * 300_000 + b'\n{"pos":[3]}')
    assert [(s.values["pos"], s.where) for s in samples] == [
        ([1], "stdin line 1"),
        ([2], "stdin line 4"),
        ([3], "stdin line 6"),
    ]
    assert caplog.messages[0].startswith("stdin line 3: not JSON")
    assert caplog.messages[1] == "1 more bad lines, the newest: stdin line 5: over 65536 bytes"


def test_a_line_without_an_end_holds_little_memory() -> None:
    assert run_bytes(b"x" * 3_000_000) == []


def test_stop_ends_a_reader_that_waits() -> None:
    read, write = os.pipe()
    reader = Read(JsonlSource(read, "stdin"))
    reader.stop.set()
    reader.join()
    os.close(read)
    os.close(write)


def test_a_file_plays_at_the_pace_of_its_clock(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    times = [100.0, 100.1, 100.2, 5000.0, 5000.1]  # a jump is not waited for
    path.write_text("".join(json.dumps({"t": t, "pos": [t]}) + "\n" for t in times))
    source = open_source(f"jsonl:{path}", None)
    assert isinstance(source, JsonlSource)
    reader = Read(source)
    reader.join()
    assert [s.t_s for _, s in reader.samples] == times
    took_s = reader.samples[-1][0] - reader.samples[0][0]
    assert 0.28 < took_s < 2.0


def test_a_fifo_outlives_its_writer(tmp_path: Path) -> None:
    path = tmp_path / "fifo"
    os.mkfifo(path)
    source = open_source(f"jsonl:{path}", None)
    assert isinstance(source, JsonlSource)
    reader = Read(source)
    for n in (1, 2):
        path.write_text(json.dumps({"pos": [n]}) + "\n")
        until(lambda n=n: len(reader.samples) == n, f"sample {n}")  # type: ignore[misc]
    assert reader.thread.is_alive()
    reader.stop.set()
    reader.join()


def test_a_path_that_is_not_there() -> None:
    with pytest.raises(SourceError, match=r"^/nowhere/x: No such file"):
        open_source("jsonl:/nowhere/x", None)


def test_unknown_kind() -> None:
    with pytest.raises(SourceError, match=f"^unknown source 'ros': one of {', '.join(KINDS)}$"):
        open_source("ros", None)
