import pytest
from posecast_loadtests.results import Clock, LoadLimits, Tally, Viewer, breaches, report
from posecast_wire.encoder import Encoder
from posecast_wire.schema import Schema, build_schema_text

TEXT = build_schema_text("demo", {"joint": ["RKN"]}, [{"name": "pos", "labels": "joint", "scale": 0.001}])


def stream(count: int, first: int = 1, key_every: int = 1000) -> list[bytes]:
    """`count` frames from seq `first` on, one every 0.1 s of robot time."""
    encoder = Encoder(Schema.parse(TEXT), key_interval_s=1e9)
    return [
        encoder.encode([at], seq=first + at, t_s=5 + at / 10, now_s=0.0, force_key=at % key_every == 0)
        for at in range(count)
    ]


def watched(decode: bool = True, step: int = 1) -> tuple[Viewer, Tally]:
    tally = Tally()
    viewer = Viewer(tally, Clock(), step, decode)
    viewer.schema(TEXT)
    return viewer, tally


@pytest.mark.parametrize("decode", [True, False])
def test_a_whole_stream(decode: bool) -> None:
    viewer, tally = watched(decode)
    for at, frame in enumerate(stream(30, key_every=10)):
        viewer.binary(frame, 100 + at / 10)
    assert (viewer.messages, viewer.frames) == (30, 30)
    assert (tally.missed, tally.duplicates, tally.reordered, tally.undecodable) == (0, 0, 0, 0)
    assert tally.percentile_ms(1.0) <= 1.0


def test_lateness_is_above_the_quickest() -> None:
    viewer, _ = watched()
    frames = stream(3)
    viewer.binary(frames[0], 100.0)
    assert viewer.binary(frames[1], 100.1) == pytest.approx(0.0)
    assert viewer.binary(frames[2], 100.5) == pytest.approx(0.3)


def test_a_third_of_the_frames_is_what_was_asked_for() -> None:
    viewer, tally = watched(step=3)
    frames = stream(31)
    for at in range(0, 31, 3):
        viewer.binary(frames[at], 100 + at / 10)
    assert (viewer.frames, tally.missed) == (11, 0)
    viewer, tally = watched(step=3)
    for at in (0, 3, 6, 12):
        viewer.binary(frames[at], 100 + at / 10)
    assert tally.missed == 1


def test_a_key_sent_ahead_is_no_late_frame() -> None:
    viewer, tally = watched(step=3)
    frames = stream(3)
    viewer.binary(frames[0], 100.0)
    assert viewer.binary(frames[2], 100.0) is not None
    assert (viewer.frames, tally.missed) == (1, 0)


def test_joining_misses_nothing() -> None:
    viewer, tally = watched()
    frames = stream(40)
    for at in (0, 30, 31):
        viewer.binary(frames[at], 100.0)
    assert tally.missed == 0


def test_what_is_wrong_is_counted() -> None:
    viewer, tally = watched()
    frames = stream(5)
    for frame in (frames[0], frames[1], frames[3], frames[3], frames[2]):
        viewer.binary(frame, 100.0)
    assert (tally.missed, tally.duplicates, tally.reordered) == (1, 1, 1)
    for junk in (b"", b"\xff" * 20, frames[4][:-1] if len(frames[4]) > 10 else b"\x10"):
        viewer.binary(junk, 100.0)
    assert tally.undecodable == 3


@pytest.mark.parametrize("decode", [True, False])
def test_a_frame_without_its_base(decode: bool) -> None:
    viewer, tally = watched(decode)
    viewer.binary(stream(2)[1], 100.0)
    assert tally.undecodable == 1


def test_a_new_run_counts_from_its_own_beginning() -> None:
    viewer, tally = watched()
    for frame in [*stream(5, first=100), *stream(5, first=1)]:
        viewer.binary(frame, 100.0)
    assert (tally.missed, tally.reordered) == (0, 0)


def full(viewers: int = 3) -> Tally:
    tally = Tally()
    for late_ms in range(1, 101):
        tally.frame(late_ms / 1000)
    for _ in range(viewers):
        tally.viewer(10.0)
    return tally


def test_percentiles_are_off_by_a_bucket_at_most() -> None:
    tally = full()
    assert tally.percentile_ms(0.5) == pytest.approx(50, rel=0.13)
    assert tally.percentile_ms(0.99) == pytest.approx(99, rel=0.13)
    tally.frame(1e6)
    assert tally.percentile_ms(1.0) == float("inf")
    assert Tally().percentile_ms(0.99) == 0.0


def test_fairness() -> None:
    assert full().jain == pytest.approx(1.0)
    unfair = Tally()
    unfair.viewer(10.0)
    unfair.viewer(0.0)
    assert unfair.jain == pytest.approx(0.5)


def test_processes_add_up() -> None:
    whole = Tally.sum([full(3).counts(), full(5).counts()])
    assert (whole.viewers, whole.frames, sum(whole.buckets)) == (8, 200, 200)
    assert whole.jain == pytest.approx(1.0)


def test_the_verdict_names_every_breach() -> None:
    assert breaches(full(), LoadLimits()) == []
    assert "all limits kept" in report(full(), LoadLimits())
    bad = full()
    bad.duplicates, bad.missed, bad.undecodable = 2, 100, 1
    text = "\n".join(breaches(bad, LoadLimits(p99_ms=50)))
    for part in ("2 duplicates", "1 undecodable", "missed 50.00%", "p99 lateness"):
        assert part in text
    assert breaches(Tally(), LoadLimits()) == ["no viewer got a frame"]
