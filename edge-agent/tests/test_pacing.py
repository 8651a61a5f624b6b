"""Sources of any rate against a fake clock: how often frames leave, and how old what they carry is."""

from __future__ import annotations

import pytest
from edge_stage import PROFILE
from posecast_edge.pipeline.intake import HOLD_S, Backlog
from posecast_edge.pipeline.stream import Stream
from posecast_edge.pipeline.view_pipeline import FramePacer
from posecast_edge.profile.reader import parse_profile
from posecast_edge.sample import Sample
from posecast_wire.decoder import Decoder

TICK_S = 1e-4


def ages(source_hz: float, hz: float, seconds: float, last: int | None = None) -> list[float]:
    """Age, s, of the sample in each frame; the source delivers `last` samples, or goes on."""
    pacer = FramePacer(hz, 0.0)
    sampled = carried = 0
    sampled_s = 0.0
    found = []
    for step in range(round(seconds / TICK_S)):
        now_s = step * TICK_S
        is_due = False
        if now_s * source_hz >= sampled and (last is None or sampled < last):
            sampled, sampled_s = sampled + 1, now_s
            is_due = pacer.is_due(now_s)
        if is_due or (sampled != carried and pacer.compute_wait_s(now_s) == 0):
            pacer.record_frame(now_s)
            if sampled != carried:
                carried = sampled
                found.append(now_s - sampled_s)
    assert last is None or carried == last, "the last value goes out"
    return found


@pytest.mark.parametrize("source_hz", [1000, 333, 200, 100, 60, 50, 40, 31, 30.03, 30, 29.97, 20, 10, 1])
def test_frames_leave_with_their_samples_at_the_rate_asked_for(source_hz: float) -> None:
    found = ages(source_hz, 30.0, 20.0)
    # what is a little faster than asked for is thinned, what is slower comes whole
    assert len(found) == pytest.approx(20 * min(source_hz, 30), abs=3)
    assert max(found) <= TICK_S, "frames leave as their samples arrive"


@pytest.mark.parametrize("source_hz", [1000, 200, 50, 31])
@pytest.mark.parametrize("last", [1, 2, 7, 50])
def test_the_last_sample_before_a_silence_goes_out_soon(source_hz: float, last: int) -> None:
    assert ages(source_hz, 30.0, 10.0, last)[-1] <= (1 + 1 / 8 + 5 / 4) / 30 + TICK_S


def test_a_thousand_samples_a_second_become_thirty_frames_each_of_the_newest() -> None:
    """Through the real stream: nothing queues, nothing is late after a minute that was not after a second."""
    stream = Stream(parse_profile(PROFILE), 4.0, lambda line: None)
    decoder = Decoder()
    decoder.add_schema(stream.schema.text)
    pacer = FramePacer(30.0, 0.0)
    behind = []
    for n in range(60_000):
        t_s = n / 1000
        stream.deliver(Sample(t_s, {"pos": [n * 0.001, 0.0]}), t_s)
        if pacer.is_due(t_s):
            pacer.record_frame(t_s)
            frame = stream.tick(t_s)
            assert frame is not None
            behind.append(n * 0.001 - (decoder.decode(frame.data).values("pos")[0] or 0.0))
    assert len(behind) in (1800, 1801)
    assert max(map(abs, behind)) <= 0.0008 + 1e-9, "the newest value to half a step and its deadband"


# --- backlog

ROBOT_S = 1000.0  # the robot's clock when ours is 0


def steady(backlog: Backlog, until_s: float, hz: float = 30.0) -> None:
    for i in range(int(until_s * hz)):
        assert not backlog.is_old(ROBOT_S + i / hz, i / hz)


def test_after_a_pause_what_was_sent_before_is_old_and_what_is_sent_now_is_not() -> None:
    backlog = Backlog()
    steady(backlog, 2.0)
    said = [backlog.is_old(ROBOT_S + 2.0 + i / 30, 12.0 + i / 30000) for i in range(300)]
    old = said.index(False)
    assert all(said[:old])
    assert not any(said[old:])
    assert 295 <= old <= 299, "new is what is at most a tenth of a second late"


def test_a_robot_that_paused_is_back_at_once() -> None:
    backlog = Backlog()
    steady(backlog, 2.0)
    assert not backlog.is_old(ROBOT_S + 12.0, 12.0)


@pytest.mark.parametrize("step_s", [-3600.0, 3600.0])
def test_a_clock_that_stepped_is_no_backlog(step_s: float) -> None:
    backlog = Backlog()
    steady(backlog, 2.0)
    assert not backlog.is_old(ROBOT_S + 2.0 + step_s, 2.03), "while samples come nothing is judged"
    backlog = Backlog()
    steady(backlog, 2.0)
    assert not backlog.is_old(ROBOT_S + 12.0 + step_s, 12.0)


def test_a_clock_that_stood_still_as_well_is_believed_after_a_second() -> None:
    """A simulation that was paused goes on where it stood."""
    backlog = Backlog()
    steady(backlog, 2.0)
    said = [backlog.is_old(ROBOT_S + 2.0 + i / 30, 12.0 + i / 30) for i in range(60)]
    assert said == [True] * round(HOLD_S * 30) + [False] * (60 - round(HOLD_S * 30))


@pytest.mark.parametrize("pace", [0.3, 1.0, 3.0])
def test_a_slow_source_whatever_its_clock_is_never_held(pace: float) -> None:
    backlog = Backlog()
    assert not any(backlog.is_old(ROBOT_S + pace * i, float(i)) for i in range(100))


def test_a_sample_without_a_time_says_nothing() -> None:
    backlog = Backlog()
    steady(backlog, 2.0)
    assert not backlog.is_old(float("nan"), 2.0)
    assert backlog.is_old(ROBOT_S + 2.0, 12.0)
