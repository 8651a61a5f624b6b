"""A corpus of broken set-ups, each with the one diagnosis it must get; and the good one, which gets none."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from command_stage import run_edge
from posecast_edge.cli.doctor import examine_source
from posecast_edge.cli.probe import describe_source
from posecast_edge.cli.source_stats import MAX_BITS, MAX_CHANNELS, SourceStats, observe_source
from posecast_edge.model.urdf.reader import load_urdf
from posecast_edge.profile.reader import parse_profile
from posecast_edge.sample import Sample, Values
from posecast_edge.sources.registry import open_source

URDF = """<robot name="arm">
<link name="base"><visual><geometry><box size="1 1 1"/></geometry></visual></link>
<link name="upper"/><link name="lower"/><link name="hand"/><link name="finger"/><link name="lift"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
  <limit lower="-1.5" upper="1.5" effort="1" velocity="1"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><axis xyz="0 0 1"/>
  <limit lower="0" upper="2.5" effort="1" velocity="1"/></joint>
<joint name="wrist" type="continuous"><parent link="lower"/><child link="hand"/><axis xyz="0 0 1"/></joint>
<joint name="grip" type="revolute"><parent link="hand"/><child link="finger"/><axis xyz="0 0 1"/>
  <limit lower="0" upper="1" effort="1" velocity="1"/><mimic joint="wrist"/></joint>
<joint name="lift" type="prismatic"><parent link="base"/><child link="lift"/><axis xyz="0 0 1"/>
  <limit lower="0" upper="0.4" effort="1" velocity="1"/></joint>
</robot>"""

PROFILE = """
[labels]
joint = ["shoulder", "elbow", "wrist", "lift"]
[[fields]]
name = "pos"
[[fields]]
name = "cur"
[[fields]]
name = "temp"
[[fields]]
name = "ftf"
labels = ["hand.fz"]
[[fields]]
name = "flags"
bits = ["jam", "hot"]
[sensors.hand]
kind = "wrench"
link = "hand"
"""
NECK = PROFILE.replace('"lift"]', '"lift", "n1", "n2"]') + "\n[joints]\n"


def good(k: int) -> dict[str, Any]:
    """A sample every 10 ms."""
    s = math.sin(k / 20)
    pos = {"shoulder": s, "elbow": 1 + s / 2, "wrist": 4 * s, "lift": 0.2 + s / 10}
    return {
        "pos": pos,
        "cur": dict.fromkeys(pos, 2 * s),
        "temp": dict.fromkeys(pos, 40.0),
        "ftf": {"hand.fz": 3.0},
        "flags": {"elbow": ["jam"] if k > 50 else []},
    }


Change = Callable[[dict[str, Any]], None]


@dataclass
class Case:
    """What is broken, and the code and words of its diagnosis."""

    name: str
    code: str
    words: str
    change: Change = lambda values: None
    profile: str = PROFILE
    clock: Callable[[int], float] = lambda k: k / 100
    arrivals: Callable[[int], float] = lambda k: k / 100
    samples: int = 200
    also: tuple[str, ...] = ()  # codes that follow from it


def scaled(field: str, factor: float, *labels: str) -> Change:
    def change(values: dict[str, Any]) -> None:
        for label in labels or values[field]:
            values[field][label] *= factor

    return change


def without(field: str, label: str | None = None) -> Change:
    def change(values: dict[str, Any]) -> None:
        if label is None:
            del values[field]
        else:
            del values[field][label]

    return change


def put(field: str, **readings: Any) -> Change:
    return lambda values: values.setdefault(field, {}).update(readings)


CORPUS = [
    Case("silent", "source-silent", "no sample within 5 s", samples=0),
    Case("few", "rate-few", "only 2 samples arrived", samples=2),
    Case("gap", "rate-gap", "no sample for 0.8 s", arrivals=lambda k: k / 100 + (0.8 if k > 100 else 0),
         clock=lambda k: k / 100 + (0.8 if k > 100 else 0)),
    Case("milliseconds", "clock-unit", "are these milliseconds?", clock=lambda k: k * 10.0),
    Case("nanoseconds", "clock-unit", "are these nanoseconds?", clock=lambda k: k * 1e7),
    Case("stopped clock", "clock-stands", "robot time stays at 7.000 s", clock=lambda k: 7.0),
    Case("slow clock", "clock-pace", "robot time runs 0.5 s a second", clock=lambda k: k / 200),
    Case("clock set back", "clock-back",
         "robot time stepped back once", clock=lambda k: k / 100 - (k > 99) * 50),
    Case("all in degrees", "unit",
         "pos of 'shoulder', 'elbow', 'wrist' reaches 229.2 rad: are these degrees?",
         scaled("pos", 180 / math.pi, "shoulder", "elbow", "wrist")),
    Case("one in degrees, not far", "unit",
         "joint 'elbow' moves from 5 to 9 rad; its limits are 0 to 2.5: are these deg",
         lambda v: v["pos"].update(elbow=7 + 2 * v["pos"]["shoulder"])),
    Case("millimetres", "unit",
         "'lift' moves from 100 to 300 m; its limits are 0 to 0.4: are these millimetres?",
         lambda v: v["pos"].update(lift=200 + 100 * v["pos"]["shoulder"])),
    Case("milliamperes", "unit", "reaches 2000 A: are these mA?", scaled("cur", 1000)),
    Case("kelvin", "unit", "reaches 313 °C: are these kelvin or °F?", put("temp", elbow=313.0)),
    Case("past its limit", "limit-exceeded",
         "joint 'shoulder' moves from -1.8 to 1.8 rad; its limits are -1.5 to 1.5",
         scaled("pos", 1.8, "shoulder")),
    Case("a joint without a channel", "joint-undriven", "no channel moves the model's joint 'lift'",
         without("pos", "lift"), profile=PROFILE.replace(', "lift"]', "]"), also=("channel-unknown",)),
    Case("a channel without a joint", "channel-moves-nothing", "channel 'tail' moves nothing",
         put("pos", tail=0.0), profile=PROFILE.replace('"lift"]', '"lift", "tail"]')),
    Case("a channel that never speaks", "channel-dead",
         "no reading for pos of 'elbow'", without("pos", "elbow")),
    Case("a channel spelled otherwise", "channel-unknown", "pos has 'Elbow', which the profile does not name",
         lambda v: v["pos"].update(Elbow=v["pos"].pop("elbow")), also=("channel-dead",)),
    Case("a field that is not there", "field-missing",
         "the profile has 'ftf', the source does not", without("ftf"),
         also=("sensor-silent",)),
    Case("no positions at all", "no-positions",
         "no pos and no ref", without("pos"), also=("field-missing",)),
    Case("another number of values", "field-length", "cur has 3 values, but the profile has 4",
         lambda v: v.update(cur=[0.0, 0.0, 0.0])),
    Case("a bit nobody named", "bit-unknown", "flags has bits the profile does not name: 'bored'",
         put("flags", elbow=["bored"])),
    Case("a mask that is too wide", "bit-unknown", "flags has masks up to 9, the profile names 2 bits",
         put("flags", elbow=9)),
    Case("a sensor without a link", "sensor-link", "sensor 'hand' without a link",
         profile=PROFILE.replace('link = "hand"', "")),
    Case("a sensor nobody mounted", "sensor-link", "sensor 'hand' without a link",
         profile=PROFILE.replace("[sensors.hand]", "[sensors.arm]")),
    Case("a dead sensor", "sensor-silent",
         "no reading from sensor 'hand'", put("ftf", **{"hand.fz": None})),
    Case("half a coupling", "coupling-dead", "joint 'elbow' needs 'n1', 'n2'; no reading for 'n2'",
         put("pos", n1=0.1), profile=NECK + "elbow.terms=[['n1',1],['n2',1]]", also=("channel-dead",)),
    Case("a coupling off its range", "coupling-limit", "is the coupling right for n1 5, n2 5?",
         put("pos", n1=5.0, n2=5.0), profile=NECK + "elbow.terms=[['n1',1],['n2',1]]"),
    Case("a coupling of nothing", "coupling-zero", "joint 'elbow' multiplies channel 'n2' by 0",
         put("pos", n1=0.1, n2=0.1), profile=NECK + "elbow.terms=[['n1',1],['n2',0]]"),
    Case("one channel, two joints", "coupling-shared",
         "channel 'wrist' moves two joints, 'wrist' and 'elbow'",
         lambda v: v["pos"].update(wrist=1.0), profile=PROFILE + "[joints]\nelbow.terms=[['wrist',1]]"),
    Case("a quaternion of no length", "quaternion", "a quaternion has length 0 … 0, not 1",
         put("quat", **{"hand.w": 0.0, "hand.x": 0.0, "hand.y": 0.0, "hand.z": 0.0}),
         profile=PROFILE + "[[fields]]\nname='quat'\nlabels=['hand.w','hand.x','hand.y','hand.z']\n"),
]  # fmt: skip


@pytest.fixture
def urdf_file(tmp_path: Path) -> Path:
    path = tmp_path / "arm.urdf"
    path.write_text(URDF, encoding="utf-8")
    return path


def watched(case: Case) -> SourceStats:
    seen = SourceStats(parse_profile(case.profile))
    for k in range(case.samples):
        values = good(k)
        case.change(values)
        seen.add(Sample(case.clock(k), values), 1000 + case.arrivals(k))
    return seen


@pytest.mark.parametrize("case", CORPUS, ids=lambda case: case.name)
def test_the_right_diagnosis(case: Case, urdf_file: Path) -> None:
    urdf = load_urdf(urdf_file)
    findings = examine_source(watched(case), urdf, 30.0)
    serious = [f for f in findings if f.severity != "hint"]
    right = [f for f in serious if f.code == case.code and case.words in f.text]
    assert right, [f.text for f in findings]
    assert {f.code for f in serious} - {case.code} <= set(case.also), "nothing else is blamed"
    assert all(f.text.isprintable() for f in findings)


def test_nothing_wrong_is_said_of_a_good_set_up(urdf_file: Path) -> None:
    assert examine_source(watched(Case("good", "", "")), load_urdf(urdf_file), 30.0) == []
    assert examine_source(watched(Case("good", "", "")), None, 30.0) == []


def test_a_slow_source_and_a_field_too_many_are_hints(urdf_file: Path) -> None:
    case = Case("slow", "", "", put("vel", elbow=0.1))
    findings = examine_source(watched(case), load_urdf(urdf_file), 120.0)
    assert [(f.severity, f.code) for f in findings] == [("hint", "field-unused"), ("hint", "rate-low")]


def test_the_page_explains_what_the_doctor_says(urdf_file: Path) -> None:
    page = (Path(__file__).parents[2] / "docs/how-to/robots/add-a-robot.md").read_text(encoding="utf-8")
    table = page.partition("| the doctor says |")[2].partition("\n\n")[0]
    explained = [
        words for row in table.splitlines()[2:] for words in re.findall(r"`([^`]+)`", row.split("|")[1])
    ]
    assert len(explained) > 10
    urdf = load_urdf(urdf_file)
    said = [f.text for case in CORPUS for f in examine_source(watched(case), urdf, 120.0)]
    for words in explained:
        pattern = re.sub(r"…|'[^']*'|[0-9.]+", "\0", words)  # names and numbers are others
        found = re.compile(".*".join(map(re.escape, pattern.split("\0"))))
        assert any(found.search(text) for text in said), words


@pytest.fixture
def files(tmp_path: Path) -> Callable[[Change], tuple[str, str]]:
    """A second of a good set-up with a change, as a file to play, and its profile. What watches it is given
    more time than that and ends with the file, also where a busy machine plays it late."""
    profile = tmp_path / "arm.toml"
    profile.write_text(PROFILE, encoding="utf-8")

    def write(change: Change) -> tuple[str, str]:
        lines = []
        for k in range(100):
            values = good(k)
            change(values)
            lines.append(json.dumps({"t": k / 100, **values}))
        path = tmp_path / "arm.jsonl"
        path.write_text("\n".join(lines), encoding="utf-8")
        return f"jsonl:{path}", str(profile)

    return write


def test_the_command_ends_with_0_1_or_2(files: Callable[[Change], tuple[str, str]], urdf_file: Path) -> None:
    source, profile = files(lambda values: None)
    flags = ("--source", source, "--profile", profile, "--urdf", str(urdf_file), "--seconds", "9")
    done = run_edge("doctor", *flags)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[-1].startswith(f"{source}: 100 samples, ")
    assert done.stdout.splitlines()[-1].endswith(": nothing wrong")
    files(scaled("cur", 1000))
    done = run_edge("doctor", *flags)
    assert done.returncode == 1
    assert (
        "error: cur of 'shoulder', 'elbow', 'wrist', 'lift' reaches 2000 A: are these mA? [unit]"
        in done.stdout
    )
    for wrong in (
        ("--source", "jsonl:/nowhere"),
        ("--source", "what"),
        ("--profile", "/no.toml", "--source", "demo"),
        (),
    ):
        done = run_edge("doctor", *wrong)
        assert done.returncode == 2, wrong
        assert done.stderr.count("\n") == 1


def test_without_a_profile_the_first_sample_is_the_profile(
    files: Callable[[Change], tuple[str, str]], urdf_file: Path
) -> None:
    source, _ = files(without("pos", "lift"))
    done = run_edge("doctor", "--source", source, "--urdf", str(urdf_file), "--seconds", "9")
    assert done.returncode == 1
    assert "no reading for pos of 'lift': that part of the body stays still [channel-dead]" in done.stdout


def test_probe_says_what_there_is(files: Callable[[Change], tuple[str, str]]) -> None:
    source, _ = files(scaled("cur", 1000))
    done = run_edge("probe", source, "--seconds", "9")
    assert done.returncode == 0
    out = done.stdout.splitlines()
    assert "100 samples in " in out[0]
    assert out[1].startswith("robot time 0.000 … 0.990 s, ")
    fields = {line.split()[0]: line for line in out[4:9]}
    assert set(fields) == {"pos", "cur", "temp", "ftf", "flags"}
    assert "A or mA?" in fields["cur"]
    assert fields["pos"].split()[1:3] == ["4", "rad"]
    assert "jam" in fields["flags"]
    assert out[-1] == "joints: shoulder elbow wrist lift"


def test_probe_of_nothing() -> None:
    done = run_edge("probe", "jsonl", "--seconds", "0.2")  # stdin is empty
    assert done.returncode == 1
    assert done.stdout == "jsonl stdin: ended without a sample\n"
    assert run_edge("probe", "what").returncode == 2


# --- source stats


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
