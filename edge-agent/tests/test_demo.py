"""Source `demo`: plays the minute in real time, for ever, in little memory."""

from __future__ import annotations

import threading
import tracemalloc
from pathlib import Path

import pytest
from demo_stage import Minute
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources import demo
from posecast_edge.sources.registry import find_defaults, open_source


def test_it_brings_profile_and_model(bundle: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demo, "BUNDLE", bundle)
    defaults = find_defaults("demo")
    assert (defaults.urdf, defaults.model) == (bundle / "robot.urdf", None)
    (tmp_path / "demo" / "model").mkdir(parents=True)
    for made in ("robot.urdf", "model/manifest.json"):
        (tmp_path / "demo" / made).touch()
    monkeypatch.setattr(demo, "BUNDLE", tmp_path / "demo")
    assert find_defaults("demo").model == tmp_path / "demo" / "model"
    monkeypatch.setattr(demo, "BUNDLE", bundle)
    assert defaults.profile is not None
    assert defaults.profile.is_file()
    assert open_source("demo", None).description == "demo, a loop of 60 s"


def test_without_a_bundle_one_line_says_how_to_make_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(demo, "BUNDLE", tmp_path / "none")
    for attempt in (lambda: open_source("demo", None), lambda: find_defaults("demo")):
        with pytest.raises(SourceError, match=r"missing .*build it with: python .*build\.py --out") as e:
            attempt()
        assert "\n" not in str(e.value)


@pytest.mark.parametrize("damage", [b"", b"posecast-motion 2\n{}\n", b"posecast-motion 1\n{}\nxx"])
def test_a_damaged_motion_is_one_line(damage: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "motion.bin").write_bytes(damage)
    monkeypatch.setattr(demo, "BUNDLE", tmp_path)
    with pytest.raises(SourceError, match=r"motion\.bin: not a motion of this version") as e:
        open_source("demo", None)
    assert "\n" not in str(e.value)


def test_a_truncated_motion_is_one_line(
    bundle: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "motion.bin").write_bytes((bundle / "motion.bin").read_bytes()[:-1000])
    monkeypatch.setattr(demo, "BUNDLE", tmp_path)
    with pytest.raises(SourceError, match="not a motion of this version"):
        open_source("demo", None)


def test_an_address_is_refused() -> None:
    with pytest.raises(SourceError, match="takes no address"):
        open_source("demo:walk", None)


def test_it_plays_on_the_clock_in_order(minute: Minute) -> None:
    samples: list[Sample] = []
    stop = threading.Event()

    def deliver(sample: Sample) -> None:
        samples.append(sample)
        if len(samples) == 30:
            stop.set()

    thread = threading.Thread(target=demo.DemoSource(minute.motion).run, args=(deliver, stop))
    thread.start()
    thread.join(20)
    assert not thread.is_alive()
    times = [s.t_s for s in samples]
    assert times[0] == 0
    assert times == sorted(set(times))
    assert all(round(t * 60) == pytest.approx(t * 60) for t in times)
    assert times[-1] < 20


def test_robot_time_goes_on_from_loop_to_loop(minute: Minute) -> None:
    first, again = minute.motion.make_sample(600), minute.motion.make_sample(600 + 3 * minute.motion.samples)
    assert again.t_s == pytest.approx(first.t_s + 180)
    assert again.values == first.values
    assert first.info == {"mode": "walking"}


def test_missing_readings_are_none_and_flags_are_masks(minute: Minute) -> None:
    sample = minute.motion.make_sample(15 * 60)
    quat, flags = sample.values["quat"], sample.values["flags"]
    assert isinstance(quat, list)
    assert isinstance(flags, list)
    assert quat[8:] == [None] * 4
    assert None not in quat[:8]
    assert all(isinstance(mask, int) for mask in flags)


def test_it_is_light(bundle: Path) -> None:
    content = (bundle / "motion.bin").read_bytes()
    tracemalloc.start()
    motion = demo.read_motion(content)
    kept, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert motion.samples == 3600
    assert kept < 3_000_000
    assert peak < 8_000_000
