"""The table of segments: every frame once, in order, whatever is damaged, missing or told twice."""

from __future__ import annotations

import io
import itertools
import random
import tracemalloc
from collections.abc import Callable, Iterator

import pytest
from posecast_relay.export import table as table_module
from posecast_relay.export.csv_file import write_csv
from posecast_relay.export.mcap_file import write_mcap
from posecast_relay.export.table import TableEvent, TableReader, TableRow
from posecast_wire import Encoder, Schema, build_schema_text
from posecast_wire.frame import TAG_KEY
from posecast_wire.segment import SegmentStart, SegmentWriter

from .export_stage import EVENT, FROM_MS, Named, Nowhere, Take, hash_of, in_order, schemas_of

COUNTER = build_schema_text("counter", {"joint": ["n", "m"]}, [{"name": "pos", "labels": "joint"}])


def rows_of(count: int, first: int = 0) -> list[list[float]]:
    return [[float(first + i), float(-i)] for i in range(count)]


def read(segments: list[Named], *texts: str, **span: int) -> tuple[list[TableRow], TableReader]:
    reader = TableReader(segments, schemas_of(*(texts or (COUNTER,))), **span)
    return [found for found in reader.read() if isinstance(found, TableRow)], reader


def counts(rows: list[TableRow]) -> list[int]:
    return [row.codes[0] for row in rows]


def test_a_take_is_read_frame_by_frame() -> None:
    take = Take(COUNTER, segment_frames=7)
    rows, reader = read(take.record(take.encode(rows_of(60))))
    assert counts(rows) == list(range(60))
    assert [row.seq for row in rows] == list(range(100, 160))
    assert [row.unix_us for row in rows] == [1000 * FROM_MS + i * 33_333 for i in range(60)]
    assert [row.robot_s for row in rows] == pytest.approx([5 + i * 0.033333 for i in range(60)], abs=6e-4)
    assert reader.losses.describe() == []


@pytest.mark.parametrize("seed", range(12))
def test_what_one_recorder_lost_comes_from_the_other(seed: int) -> None:
    dice = random.Random(seed)
    count = 400
    first, second = (Take(COUNTER, take=n, segment_frames=dice.randint(1, 40)) for n in (1, 2))
    frames = first.encode(rows_of(count))
    lost = [{i for i in range(1, count) if dice.random() < 0.2} for _ in range(2)]
    late_us = dice.choice([-900_000, -3000, 0, 4000, 1_500_000])

    def heard(which: int) -> Callable[[int], bool]:
        # a recorder that lost a base hears nothing more until the next KEY: this one has them all
        return lambda i: frames[i][0] == TAG_KEY or i not in lost[which]

    both = in_order(first.record(frames, heard=heard(0)), second.record(frames, late_us, heard(1)))
    rows, reader = read(both)
    assert counts(rows) == [i for i in range(count) if heard(0)(i) or heard(1)(i)]
    assert reader.losses.describe() == []


def test_numbers_go_round_and_a_new_run_begins_with_any() -> None:
    first = Take(COUNTER, segment_frames=5)
    second = Take(COUNTER, take=3, run_id=4, from_ms=FROM_MS + 4000, segment_frames=5)
    ends = first.record(first.encode(rows_of(20), (1 << 32) - 9))
    begins = second.record(second.encode(rows_of(20, 1000), 0))
    rows, _ = read([*ends, *begins])
    assert counts(rows) == [*range(20), *range(1000, 1020)]


def test_runs_at_the_same_time_go_by_time() -> None:
    first, second = Take(COUNTER), Take(COUNTER, take=3, run_id=4)
    both = in_order(
        first.record(first.encode(rows_of(40))), second.record(second.encode(rows_of(40)), 10_000)
    )
    rows, _ = read(both)
    assert [row.unix_us for row in rows] == sorted(row.unix_us for row in rows)
    assert len(rows) == 80


def test_a_gap_is_a_gap() -> None:
    take = Take(COUNTER, segment_frames=10)
    segments = take.record(take.encode(rows_of(50)))
    rows, reader = read([*segments[:1], *segments[3:]])
    assert counts(rows) == [*range(10), *range(30, 50)]
    assert reader.losses.describe() == []


@pytest.mark.parametrize(
    ("harm", "reason"),
    [
        (lambda data: data[:-1], "cut short"),
        (lambda data: data[:100] + bytes([data[100] ^ 1]) + data[101:], "damaged"),
        (lambda data: b"", "cut short"),
        (lambda data: data[:4] + b"\2" + data[5:], "version"),
    ],
)
def test_a_damaged_segment_is_passed_over_and_counted(harm: Callable[[bytes], bytes], reason: str) -> None:
    take = Take(COUNTER, segment_frames=10)
    segments = take.record(take.encode(rows_of(50)))
    name, data = segments[2]
    segments[2] = (name, harm(data))
    rows, reader = read(segments)
    assert counts(rows) == [*range(20), *range(30, 50)]
    assert reader.losses.segments == 1
    (line,) = reader.losses.describe()
    assert line.startswith(f"passed over 1 segment; the first: {name}: ")
    assert reason in line or reason == "version"


def test_a_segment_whose_schema_is_missing_or_wrong_is_passed_over() -> None:
    take, other = Take(COUNTER), Take(COUNTER.replace("counter", "other"), take=3, from_ms=FROM_MS + 9000)
    segments = [*take.record(take.encode(rows_of(40))), *other.record(other.encode(rows_of(40), 500))]
    rows, reader = read(segments)
    assert counts(rows) == list(range(40))
    assert "its schema is not here" in reader.losses.describe()[0]
    reader = TableReader(segments, {hash_of(COUNTER): COUNTER, hash_of(other.schema_text): "{}"})
    assert len(list(reader.read())) == 40
    assert 'its schema: type: must be "schema"' in reader.losses.describe()[0]
    reader = TableReader(segments, {hash_of(COUNTER): other.schema_text})  # under a name that is not its own
    assert list(reader.read()) == []
    assert reader.losses.describe()[0].startswith("passed over 2 segments and 40 frames; the first: ")


def test_only_the_span_is_read_and_its_ends_are_in_it() -> None:
    take = Take(COUNTER, step_us=10_000, segment_frames=10)
    rows, _ = read(take.record(take.encode(rows_of(50))), from_ms=FROM_MS + 100, to_ms=FROM_MS + 200)
    assert counts(rows) == list(range(10, 21))


def test_events_come_once_and_in_time() -> None:
    first, second = Take(COUNTER, segment_frames=9), Take(COUNTER, take=8, segment_frames=7)
    frames = first.encode(rows_of(40))
    told = {5: {**EVENT, "text": "a", "state": "on"}, 30: {**EVENT, "n": 42, "text": "b", "state": "on"}}
    both = in_order(first.record(frames, events=told), second.record(frames, 2000, events=told))
    found = list(TableReader(both, schemas_of(COUNTER)).read())
    assert len(found) == 42
    assert [i for i, each in enumerate(found) if isinstance(each, TableEvent)] == [5, 31]
    assert [each.unix_us for each in found] == sorted(each.unix_us for each in found)


def test_more_than_may_wait_is_read_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_module, "WAITING_BYTES_MAX", 20_000)
    takes = [Take(COUNTER, take=n, run_id=n + 1, segment_frames=60) for n in range(30)]
    frames = takes[0].encode(rows_of(60))
    segments = in_order(*(take.record(frames, n) for n, take in enumerate(takes)))
    rows, reader = read(segments)
    assert sorted(counts(rows)) == sorted(list(range(60)) * 30)
    assert reader.losses.describe() == []
    asked = iter(segments)
    next(TableReader(asked, schemas_of(COUNTER)).read())
    assert len(list(asked)) > 20, "the others have not been asked for"


def test_what_has_been_read_waits_no_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_module, "WAITING_BYTES_MAX", 100_000)
    first, second = Take(COUNTER, take=1, segment_frames=20), Take(COUNTER, take=2, segment_frames=20)
    frames = first.encode(rows_of(1000))
    lost = first.record(frames, heard=lambda i: frames[i][0] == TAG_KEY or i % 7 > 0)
    rows, _ = read(in_order(lost, second.record(frames, 500_000)))
    assert counts(rows) == list(range(1000))


def long_past(seconds: int, hz: int = 60) -> Iterator[Named]:
    """Segments of a second each, made as they are asked for."""
    schema = Schema.parse(COUNTER)
    for k in range(seconds):
        encoder = Encoder(schema, 4.0)
        start = SegmentStart(
            "demo", "public", 7, k, 9, FROM_MS + 1000 * k, hash_of(COUNTER), missing=0, numbering="one"
        )
        writer = SegmentWriter(start)
        for i in range(hz):
            n = k * hz + i
            frame = encoder.encode([n % 5000, i], n, n / hz, n / hz)
            writer.append_frame(frame, i * 1_000_000 // hz, 0)
        yield f"{k}", writer.close(FROM_MS + 1000 * k + 999)


@pytest.mark.parametrize("kind", ["csv", "mcap"])
def test_memory_does_not_grow_with_length(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("posecast_relay.export.mcap_file.CHUNK_BYTES", 1 << 16)

    def find_peak_bytes(seconds: int) -> int:
        file = io.BufferedWriter(Nowhere())
        table = TableReader(long_past(seconds), schemas_of(COUNTER))
        tracemalloc.start()
        count = write_csv(file, table) if kind == "csv" else write_mcap(file, table)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert count == 60 * seconds
        return peak

    find_peak_bytes(2)  # imports
    short, long = find_peak_bytes(10), find_peak_bytes(50)
    # MCAP has an index of its chunks, some hundred bytes for each
    assert long < short + (100_000 if kind == "csv" else 300_000)


def test_it_is_read_while_it_is_written() -> None:
    asked: list[str] = []

    def told() -> Iterator[Named]:
        for name, data in long_past(30):
            asked.append(name)
            yield name, data

    rows = TableReader(told(), schemas_of(COUNTER)).read()
    list(itertools.islice(rows, 60))
    assert len(asked) <= 5
