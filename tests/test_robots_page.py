"""The statements in docs/how-to/robots/ and docs/reference/profile.md are true; test_source_doctor.py checks
the findings."""

from __future__ import annotations

import inspect
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from posecast_command.completion import make_whole_parser
from posecast_edge.pipeline.stream import Stream
from posecast_edge.profile.defaults import UNITS, WELL_KNOWN
from posecast_edge.profile.reader import ROLES, SHIPPED, parse_profile
from posecast_edge.profile.schema import infer_profile, make_schema_text
from posecast_edge.robot import Robot
from posecast_edge.sources.hubo.state import LAYOUTS
from posecast_edge.sources.jsonl import parse_line
from posecast_edge.sources.lines import MAX_LINE
from posecast_edge.sources.merge import STATE_S, STREAM_S
from posecast_edge.sources.published.checks import PROBLEMS_MAX
from posecast_edge.sources.published.readings import KEPT_MAX
from posecast_edge.sources.published.source import SETTLE_S
from posecast_edge.sources.registry import KINDS
from posecast_edge.sources.ros.messages import PAYLOAD_MAX
from posecast_edge.sources.ros.ros2 import BACKLOG_MAX
from posecast_edge.sources.ros.rosbridge import LOOK_S, THROTTLE_MS
from posecast_edge.sources.ros.topics import TYPES
from posecast_wire.decoder import Decoder
from posecast_wire.schema import Schema

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
GUIDE = (DOCS / "how-to/robots/add-a-robot.md").read_text(encoding="utf-8")
PROFILE = (DOCS / "reference/profile.md").read_text(encoding="utf-8")
OF_SOURCE = {
    path.stem: path.read_text(encoding="utf-8") for path in sorted((DOCS / "how-to/robots").glob("*.md"))
}
PAGE = "\n".join([PROFILE, *OF_SOURCE.values()])
LINK = re.compile(r"\]\(([^)#:]+\.md)(?:#([^)]*))?\)")


def blocks(language: str, page: str) -> list[str]:
    return re.findall(rf"^ *```{language}\n(.*?)^ *```", page, re.DOTALL | re.MULTILINE)


@pytest.mark.docs
def test_the_profile_on_the_page_is_one() -> None:
    text, _ = blocks("toml", PROFILE)
    profile = parse_profile(text)
    Schema.parse(make_schema_text(profile))
    for view in profile.views.values():
        Schema.parse(make_schema_text(profile.restrict_to_view(view)))
    assert set(profile.views) == {"public", "lab"}
    assert profile.mapping.joints["knuckle2"].terms == (("RF1", 0.8),)


@pytest.mark.docs
def test_the_bipeds_profile_has_all_that_balance_needs() -> None:
    schema = Schema.parse(make_schema_text(parse_profile(blocks("toml", PROFILE)[1])))
    labels = {field.name: field.labels for field in schema.fields}
    balance = schema.mapping.balance
    assert balance.feet is not None
    assert balance.ground == "measured"
    for foot in balance.feet:
        assert schema.mapping.sensors[foot].link is not None
        assert {f"{foot}.f{c}" for c in "xyz"} <= set(labels["ftf"])
        assert {f"{foot}.m{c}" for c in "xyz"} <= set(labels["ftm"])
        assert {z for _, _, z in balance.soles[foot]} == {-0.05}
    assert (labels["base"], labels["baseq"]) == (
        ("base.x", "base.y", "base.z"),
        ("base.w", "base.x", "base.y", "base.z"),
    )
    assert schema.mapping.find_threshold("balance", "margin") is not None


@pytest.mark.docs
@pytest.mark.parametrize("name", sorted(OF_SOURCE))
def test_commands_are_in_blocks_of_shell(name: str) -> None:
    prose = re.sub(r"^ *```sh\n.*?^ *```", "", OF_SOURCE[name], flags=re.DOTALL | re.MULTILINE)
    bare = re.findall(r"^ *(?:posecast|posecast-\w+|pip|python) .*$", prose, re.MULTILINE)
    assert bare == [], "else they run together into a paragraph"


def list_commands(page: str) -> list[list[str]]:
    """The posecast commands in the page's shell blocks."""
    lines = "".join(blocks("sh", page)).splitlines()
    found = [re.match(r" *(?:.* \| )?posecast (.*)", line) for line in lines]
    return [shlex.split(each[1]) for each in found if each]


@pytest.mark.docs
def test_every_command_is_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my-robot.credential").write_text(f"posecast1:my-robot:{'s' * 43}\n", encoding="ascii")
    Path("my-robot.credential").chmod(0o600)
    commands = [words for page in (*OF_SOURCE.values(), PROFILE) for words in list_commands(page)]
    assert len(commands) > 20
    for words in commands:
        make_whole_parser().parse_args(words)  # ends the process on a flag that is none


@pytest.mark.docs
def test_the_known_fields_are_those_that_the_agent_knows() -> None:
    table = PROFILE.partition("<!-- fields -->")[2].partition("<!-- /fields -->")[0]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()[3:] if line]
    listed = {name.strip("`"): (of == "joint", unit, float(step)) for name, of, _, unit, step in rows}
    assert listed == {name: (known.joints, known.unit, known.scale) for name, known in WELL_KNOWN.items()}


@pytest.mark.docs
def test_the_topics_on_the_page_are_a_table_of_a_profile() -> None:
    (text,) = blocks("toml", OF_SOURCE["ros2"])
    ros = parse_profile('[[fields]]\nname = "pos"\nlabels = ["a"]\n' + text).ros
    assert ros is not None
    assert {*ros.topics, "base"} == set(ROLES)
    assert ros.base_frames == ("odom", "base_link")
    assert ros.topics["wrench"] == (("/ft/right", "RF"), ("/ft/left", "LF"))
    assert (ros.domain, ros.encoding) == (0, "json")


@pytest.mark.docs
def test_the_columns_on_the_page_are_a_table_of_a_profile() -> None:
    (text,) = blocks("toml", OF_SOURCE["recordings"])
    assert len(parse_profile('[[fields]]\nname = "pos"\nlabels = ["a"]\n' + text).csv) == 3


@pytest.mark.docs
def test_every_ros_type_is_on_it() -> None:
    assert [name for name in TYPES if f"`{name}`" not in PAGE] == []
    assert (STREAM_S, STATE_S, PAYLOAD_MAX, BACKLOG_MAX) == (1.5, 60, 256 << 10, 4 << 20)
    assert [
        words
        for words in ("1.5 s", "60 s", "256 KiB", "4 MiB", "again every second", "every 10 s")
        if words not in PAGE
    ] == []
    assert (THROTTLE_MS, LOOK_S) == (15, (1, 10))
    assert "`throttle_rate: 15` with `queue_length: 1`" in PAGE


@pytest.mark.docs
def test_every_source_unit_profile_and_version_is_on_it() -> None:
    assert [kind for kind in KINDS if f"`{kind}" not in PAGE] == []
    assert [unit for unit in set(UNITS.values()) if unit and unit not in PAGE] == []
    assert [path.stem for path in SHIPPED.glob("*.toml") if f"`{path.stem}`" not in PAGE] == []
    assert [size for size in LAYOUTS if str(size) not in PAGE] == []


@pytest.mark.docs
def test_every_source_has_a_page_that_the_guide_links_to_and_starts_with_a_command() -> None:
    rows = [line.split("|") for line in GUIDE.splitlines() if line.count("|") == 5]
    pages = {kind: row[4] for row in rows for kind in KINDS if re.search(rf"`{kind}[:`\[]", row[2])}
    assert set(pages) == set(KINDS)
    for kind, cell in pages.items():
        if kind == "demo":
            continue
        page = OF_SOURCE[Path(LINK.findall(cell)[0][0]).stem]
        assert f"--source {kind}" in page or f"--source '{kind}" in page, kind


@pytest.mark.docs
def test_its_program_is_that_of_the_readme_which_is_run() -> None:
    """So what the home page and the page about installation pipe into Posecast can be copied from it."""
    (program,) = blocks("python", OF_SOURCE["jsonl"])
    assert program.startswith("# wave.py\n")
    assert blocks("python", (ROOT / "README.md").read_text(encoding="utf-8"))[0] == program
    for name, link in (("index", "how-to/robots/"), ("how-to/install/install", "../robots/")):
        page = (DOCS / f"{name}.md").read_text(encoding="utf-8")
        assert "python3 wave.py |" in page
        assert f"({link}jsonl.md#write-a-program)" in page


@pytest.mark.docs
def test_the_lines_of_a_program_on_its_page_make_frames() -> None:
    """With a profile and without, as the page says."""
    (text,) = blocks("json", OF_SOURCE["jsonl"])
    profile = parse_profile(
        '[labels]\njoint = ["RKN", "LKN"]\n[[fields]]\nname = "pos"\n'
        '[[fields]]\nname = "flags"\nbits = ["jam"]\n'
    )
    lines = [parse_line(line.encode(), 0.0)[0] for line in text.splitlines()]
    for used in (profile, infer_profile("r1", lines[0])):
        said: list[str] = []
        stream = Stream(used, 4.0, said.append)
        events = [(e.source, e.text, e.on) for line in lines for e in stream.deliver(line, line.t_s)]
        assert events == [("RKN", "jam", True), ("RKN", "jam", False)]
        frame = stream.tick(12.5)
        assert frame is not None
        decoder = Decoder()
        decoder.add_schema(stream.schema.text)
        decoded = decoder.decode(frame.data)
        pos = stream.schema.find_field("pos")
        assert pos is not None
        assert dict(zip(pos.labels, decoded.values("pos"), strict=True)) == pytest.approx(
            {"RKN": 0.6, "LKN": 0.1}
        )
        assert decoded.t_s == pytest.approx(12.4)
        assert said == []
    assert MAX_LINE == 1 << 20


def test_the_page_of_python_names_every_argument_and_its_programs_run(tmp_path: Path) -> None:
    page = OF_SOURCE["python"]
    for method in (Robot.__init__, Robot.publish):
        names = [
            name for name in inspect.signature(method).parameters if name not in ("self", "wrong", "others")
        ]
        assert [name for name in names if f"`{name}`" not in page] == []
    assert (STREAM_S, STATE_S, SETTLE_S, KEPT_MAX, PROBLEMS_MAX) == (1.5, 60, 0.5, 64, 50)
    shutil.copy(ROOT / "edge-agent/examples/arm.urdf", tmp_path)
    first, second, _, silence = blocks("python", page)
    (from_urdf,) = blocks("python", OF_SOURCE["urdf"])
    arm = from_urdf.replace("robot.urdf", "arm.urdf")
    for program in (first, second, arm, silence + first):
        away = program.replace(":7447", ":1").replace("while True:", "for _ in range(3):")
        said = "print(robot.status().problems, robot.status().link)"
        done = subprocess.run(
            [sys.executable, "-c", f"{away}{said}"], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert (done.stdout, done.returncode) == ("{} closed\n", 0), done.stderr


@pytest.mark.docs
def test_the_trajectory_on_its_page_is_a_table_of_a_profile() -> None:
    (text,) = blocks("toml", OF_SOURCE["trajectory"])
    labels = '[labels]\njoint = ["LKN", "RKN"]\n[[fields]]\nname = "ref"\n[[fields]]\nname = "pos"\n'
    trajectory = parse_profile(labels + text).trajectory
    assert trajectory is not None
    assert (trajectory.columns, trajectory.rate_hz, trajectory.lag_s) == (("LKN", "RKN", "-"), 200, 0.012)
