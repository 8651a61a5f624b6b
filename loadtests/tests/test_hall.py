"""A full relay refuses nobody: a hall's viewers go on in the lane, also while the relay is replaced."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from posecast_loadtests.hall import (
    FAILURES_MAX,
    HallCounts,
    HallViewer,
    LaneReader,
    Replacement,
    find_breaches,
    make_report,
    play,
)
from posecast_wire import Encoder, Schema, build_schema_text
from posecast_wire.segment import FrameRecord, Segment, SegmentStart, encode_segment


@pytest.mark.parametrize(("viewers", "places"), [(30, 5), pytest.param(500, 50, marks=pytest.mark.full)])
def test_nobody_is_refused_while_the_relay_is_replaced(viewers: int, places: int, tmp_path: Path) -> None:
    counts, replaced = play(viewers, places, tmp_path)
    report = make_report(counts, viewers, places, replaced)
    assert find_breaches(counts, viewers, places, replaced) == [], report
    assert counts.count_served(replaced.serves_s) == viewers, report
    assert counts.told_lane >= viewers - places, report
    assert counts.moved >= places, report
    print(report)


# ---- the verdict -------------------------------------------------------------------


REPLACED = Replacement(10.0, 12.0)


def make_counts(*last_s: float, by: str = "lane", **more: Any) -> HallCounts:
    viewers = [HallViewer(by, at_s, 5.0) for at_s in last_s]
    return HallCounts(viewers=viewers, **{"told_lane": 1, **more})


def test_all_of_it_held() -> None:
    assert find_breaches(make_counts(13.0, 14.0), 2, 1, REPLACED) == []
    assert "all of it held" in make_report(make_counts(13.0, 14.0), 2, 1, REPLACED)


@pytest.mark.parametrize(
    ("counts", "said"),
    [
        (make_counts(13.0), "1 viewers came, not 2"),
        (make_counts(13.0, 11.0), "1 viewers received nothing after the relay was replaced"),
        (make_counts(13.0, 14.0, told_lane=0), "only 0 were sent to the lane"),
        (make_counts(13.0, 14.0, by="socket"), "only 0 used the lane, not 1"),
        (make_counts(13.0, 14.0, refusals=[(9.0, "socket: 1013")]), "1 refused, the first: socket: 1013"),
        (make_counts(13.0, 14.0, repeats=1), "1 repeats"),
        (make_counts(13.0, 14.0, missed=3), "3 missed"),
    ],
)
def test_what_did_not_hold_is_named(counts: HallCounts, said: str) -> None:
    assert said in find_breaches(counts, 2, 1, REPLACED)
    assert f"BREACH       {said}" in make_report(counts, 2, 1, REPLACED)


def test_a_refusal_while_there_is_no_relay_is_none() -> None:
    assert find_breaches(make_counts(13.0, 14.0, refusals=[(11.0, "lane: 503")]), 2, 1, REPLACED) == []


def test_counts_survive_a_file() -> None:
    counts = make_counts(13.0, refusals=[(1.5, "x")])
    assert HallCounts.read(json.loads(json.dumps(counts.write()))) == counts


def test_the_longest_wait_of_a_viewer() -> None:
    viewer = HallViewer()
    for at_s in (100.0, 104.0, 111.0, 115.0):
        viewer.show("lane", at_s)
    assert (viewer.longest_s, viewer.last_s) == (7.0, 115.0)


# ---- what is read ------------------------------------------------------------------


class Answers:
    """Stands where a connection would: what each request of a reader is answered with."""

    def __init__(self, *answers: tuple[int, bytes, dict[str, str]]) -> None:
        self.answers = list(answers)
        self.asked: list[str] = []

    def request(self, _method: str, path: str) -> None:
        self.asked.append(path)
        if not self.answers:
            raise ConnectionRefusedError

    def getresponse(self) -> Answers:
        self.status, self.body, self.headers = self.answers.pop(0)
        self.reason = "as said"
        return self

    def read(self, _most: int) -> bytes:
        return self.body

    def close(self) -> None:
        pass


NAME = {"take": f"{1:016x}", "index": 3}
EMPTY: dict[str, str] = {}


def make_reader(*answers: tuple[int, bytes, dict[str, str]]) -> tuple[LaneReader, HallCounts, Answers]:
    counts, link = HallCounts(), Answers(*answers)
    reader = LaneReader("http://relay.lab/api/v1/robots/demo/past/public", counts, lambda: None)
    reader._http = link  # type: ignore[assignment]
    return reader, counts, link


def test_it_begins_with_the_newest_and_begins_anew_where_a_name_is_unknown() -> None:
    newest = json.dumps({"newest": NAME}).encode()
    reader, counts, link = make_reader((200, newest, EMPTY), (404, b"", EMPTY), (200, newest, EMPTY))
    for _ in range(3):
        reader.ask()
    past = "/api/v1/robots/demo/past"
    assert link.asked == [f"{past}?view=public", f"{past}/public/{1:016x}/3", f"{past}?view=public"]
    assert (counts.begun_anew, counts.refusals) == (1, [])


def test_it_goes_on_with_the_take_that_it_is_named() -> None:
    as_json = {"content-type": "application/json"}
    newest, after = {"newest": NAME}, {"next": {"take": f"{2:016x}", "index": 0}}
    answers = [(200, json.dumps(said).encode(), as_json) for said in (newest, after)]
    reader, _, link = make_reader(*answers)
    for _ in range(3):
        reader.ask()
    assert link.asked[2].endswith(f"/public/{2:016x}/0")


def test_other_answers_are_refusals_and_after_some_the_lane_is_over() -> None:
    reader, counts, _ = make_reader((503, b"", EMPTY))
    for _ in range(FAILURES_MAX):
        assert not reader.is_over
        reader.ask()
    assert reader.is_over
    assert [text for _, text in counts.refusals] == ["lane: 503 as said"]
    assert counts.away == FAILURES_MAX - 1


FIELDS = [{"name": "pos", "labels": "joint", "unit": "rad", "scale": 0.001}]
SCHEMA = Schema.parse(build_schema_text("demo", {"joint": ["A"]}, FIELDS))


def make_segment(take: int, index: int, *seqs: int, run: int = 7) -> tuple[int, bytes, dict[str, str]]:
    start = SegmentStart("demo", "public", take, index, run, 1_800_000_000_000 + 1000 * index, "ab" * 32)
    encoder = Encoder(SCHEMA)
    frames = (FrameRecord(0, 0, seq, encoder.encode([seq], seq, seq / 30, seq / 30)) for seq in seqs)
    return 200, encode_segment(Segment(start, start.from_ms + 1000, tuple(frames))), EMPTY


def read_all(*segments: tuple[int, bytes, dict[str, str]]) -> HallCounts:
    newest = json.dumps({"newest": {"take": f"{1:016x}", "index": 0}}).encode()
    reader, counts, _ = make_reader((200, newest, EMPTY), *segments)
    for _ in range(1 + len(segments)):
        reader.ask()
    return counts


def test_a_frame_that_is_missing_or_comes_twice_is_counted() -> None:
    counts = read_all(make_segment(1, 0, 1, 2, 3), make_segment(1, 1, 6, 7), make_segment(1, 2, 7, 8))
    assert (counts.segments, counts.missed, counts.repeats, counts.unreadable) == (3, 2, 1, 0)


def test_another_run_counts_from_its_own_beginning() -> None:
    counts = read_all(make_segment(1, 0, 8, 9), make_segment(1, 1, 1, 2, run=8))
    assert (counts.segments, counts.missed, counts.repeats) == (2, 0, 0)


def test_another_segment_than_was_asked_for_is_unreadable() -> None:
    assert read_all(make_segment(1, 5, 1)).unreadable == 1
    assert read_all((200, b"\x89PCS", EMPTY)).unreadable == 1
