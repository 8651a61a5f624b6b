from __future__ import annotations

from pathlib import Path

from posecast_edge.cli.probe import describe_source
from posecast_edge.cli.source_stats import MAX_BITS, MAX_CHANNELS, SourceStats, observe_source
from posecast_edge.sample import Sample, Values
from posecast_edge.sources.registry import open_source


def test_a_source_that_invents_names_does_not_fill_the_memory() -> None:
    seen = SourceStats()
    for i in range(5000):
        values: dict[str, Values] = {f"f{i}": [1.0], "pos": {f"j{i}": 1.0}, "flags": {"A": [f"b{i}"]}}
        seen.add(Sample(float(i), values, {f"k{i}": "x"}), float(i))
    assert seen.samples == 5000
    assert len(seen.fields) == MAX_CHANNELS
    assert len(seen.fields["pos"]) == MAX_CHANNELS
    assert len(seen.fields["flags"]["A"].bits) == MAX_BITS
    assert len(seen.info) == MAX_CHANNELS


def test_what_is_no_number_is_no_reading() -> None:
    seen = SourceStats()
    seen.add(Sample(0.0, {"pos": {"A": 10**400, "B": float("inf"), "C": float("nan"), "D": -2}}), 0.0)
    assert [c.readings for c in seen.fields["pos"].values()] == [0, 0, 0, 1]
    assert seen.fields["pos"]["D"].last == -2.0
    assert describe_source("a test", seen)


def test_a_source_that_ends_without_a_sample_is_not_called_silent(tmp_path: Path) -> None:
    path = tmp_path / "empty.jsonl"
    path.touch()
    seen = observe_source(open_source(f"jsonl:{path}", None), 1.0)
    assert describe_source("jsonl", seen) == ["jsonl: ended without a sample"]


def test_the_names_of_many_joints_stand_in_lines_a_person_can_read() -> None:
    seen = SourceStats()
    names = [f"left_arm_{i}_pitch" for i in range(3000)]
    seen.add(Sample(0.0, {"pos": dict.fromkeys(names, 0.5)}), 0.0)
    lines = describe_source("a test", seen)
    assert max(map(len, lines)) <= 160
    said = " ".join(lines).partition("joints: ")[2]
    assert said.split() == names
