from __future__ import annotations

import time

import pytest
from posecast_edge import kit
from posecast_edge.uplink.session import Run


def test_time_asleep_counts_where_the_platform_can_tell(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "clock_gettime_ns", {7: 60_000_000_000}.__getitem__)
    monkeypatch.setattr(kit, "_BOOTTIME", 7)
    assert (kit.now_ns(), kit.now_s()) == (60_000_000_000, 60.0)


def test_elsewhere_it_is_the_monotonic_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kit, "_BOOTTIME", None)
    monkeypatch.setattr(time, "monotonic_ns", lambda: 5_000_000_000)
    assert kit.now_s() == 5.0


def test_a_stamp_says_when_its_sample_was_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    now_ns = [1_000_000_000]
    monkeypatch.setattr(kit, "now_ns", lambda: now_ns[0])
    run = Run()
    now_ns[0] = 61_500_000_000  # a minute asleep
    assert run.make_stamp().elapsed_ns == 60_500_000_000
    assert run.make_stamp(3.0).elapsed_ns == 2_000_000_000
    assert run.make_stamp(0.5).elapsed_ns == 0, "of before the run began"
