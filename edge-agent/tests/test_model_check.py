"""What a program publishes beside its robot's model, with and without the mesh tools."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path

import pytest
from model_stage import joint, link, mesh, robot, written
from posecast_edge import kit
from posecast_edge.model.serve.bundle import load_bundle
from posecast_edge.profile.reader import parse_profile
from posecast_edge.sample import Sample
from posecast_edge.sources.published.checks import BACK, ERRORS_MAX, ClockCheck, ModelCheck, ProblemList
from posecast_edge.sources.published.readings import Copied, PublishedSlot
from posecast_edge.sources.published.source import PublishedSource

ARM = (
    *map(link, "abcd"),
    joint("elbow", "a", "b", limit='<limit lower="-2.6" upper="2.6" velocity="1" effort="1"/>'),
    joint("extend", "b", "c", "prismatic", limit='<limit lower="0" upper="0.3" velocity="1" effort="1"/>'),
    joint("rest", "c", "d", "planar"),
)
BROKEN = (
    link("a", mesh("meshes/gone.stl")),
    link("b"),
    joint("ab", "a", "b", inside='<axis xyz="0 a 0"/>'),
    joint("lost", "nowhere", "b"),
)
GONE = (
    "mesh 'meshes/gone.stl' of link 'a': no such file; looked for 'robot/meshes/gone.stl' and any 'gone.stl' "
    "in the robot's folder"
)
FINDINGS = {
    GONE,
    "joint 'ab': <axis xyz> is not a number: '0 a 0'",
    "joint 'lost': its parent link 'nowhere' does not exist; this joint is left out",
}
ELBOW = "pos of 'elbow' is far beyond the joint's limits, -2.6 to 2.6 rad"
EXTEND = "pos of 'extend' is far beyond the joint's limits, 0 to 0.3 m"
# as where the extra `model` is not installed
PLAIN = "import sys; sys.modules['numpy'] = sys.modules['PIL'] = None\n"


def checked(folder: Path, *parts: str) -> tuple[ModelCheck, ProblemList]:
    problems = ProblemList()
    check = ModelCheck(problems)
    check.take_model(load_bundle(written(folder / "robot", robot(*parts))))
    return check, problems


def texts(problems: ProblemList) -> set[str]:
    return {text.partition(": ")[2].partition(": ")[2] for text in problems.get_counts()}


def test_errors_of_a_model_are_told_once(tmp_path: Path) -> None:
    check, problems = checked(tmp_path, *BROKEN)
    assert texts(problems) == FINDINGS
    assert f"model: line 2: {GONE}" in problems.get_counts()
    check.take_model(load_bundle(tmp_path / "robot" / "robot.urdf"))
    assert set(problems.get_counts().values()) == {1}


def test_a_model_with_many_errors_does_not_fill_the_list(tmp_path: Path) -> None:
    _, problems = checked(tmp_path, *(joint(f"j{i}", "nowhere", "a") for i in range(200)), link("a"))
    assert len(problems.get_counts()) == ERRORS_MAX + 1
    assert "doctor --urdf` lists them" in [*problems.get_counts()][-1]


def test_names_that_move_nothing(tmp_path: Path) -> None:
    check, problems = checked(tmp_path, *ARM)
    assert problems.get_counts() == {}
    names = frozenset(("elbow", "elbo", "Extend", "rest/x", "rest/z"))
    for _ in range(2):
        check.check_names({"pos": names})
    assert problems.get_counts() == {
        f"pos of {name!r} moves nothing: the model has no such joint": 1
        for name in ("Extend", "elbo", "rest/z")
    }


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"elbow": 2.7, "extend": 0.4, "rest/x": 50.0}, {}),
        ({"elbow": -90.0}, {f"{ELBOW}: are these degrees?": 2}),
        ({"elbow": 2000.0}, {ELBOW: 2}),
        ({"extend": 50.0}, {f"{EXTEND}: are these millimetres?": 2}),
        ({"extend": 5000.0, "elbow": None}, {EXTEND: 2}),
    ],
)
def test_positions_far_beyond_the_limits(
    tmp_path: Path, values: dict[str, float | None], said: dict[str, int]
) -> None:
    check, problems = checked(tmp_path, *ARM)
    for _ in range(2):
        check.check_positions({"pos": values, "vel": {"elbow": 500.0}})
    assert problems.get_counts() == said


def test_of_many_joints_in_degrees_one_is_named(tmp_path: Path) -> None:
    joints = [joint(f"j{i}", "a", f"l{i}") for i in range(9)]
    check, problems = checked(tmp_path, link("a"), *(link(f"l{i}") for i in range(9)), *joints)
    check.check_positions({"ref": {f"j{i}": 45.0 for i in range(9)}})
    [(text, count)] = problems.get_counts().items()
    assert (text[:11], text[-23:], count) == ("ref of 'j0'", "rad: are these degrees?", 9)


def test_a_program_without_the_mesh_tools_is_told_all_that(tmp_path: Path) -> None:
    path = written(tmp_path / "robot", robot(*BROKEN))
    program = PLAIN + (
        "import posecast, time\n"
        f"with posecast.Robot('r1', urdf={str(path)!r}, relay='tcp/127.0.0.1:1') as robot:\n"
        "    until_s = time.monotonic() + 30\n"
        "    while len(robot.status().problems) < 4 and time.monotonic() < until_s:\n"
        "        robot.publish(pos={'elbo': 0.1})\n"
        "        time.sleep(0.01)\n"
        "print(*robot.status().problems, sep='\\n')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True
    )
    said = done.stdout.splitlines()
    assert {line.partition(": ")[2].partition(": ")[2] for line in said[:3]} == FINDINGS
    assert said[3:] == ["pos of 'elbo' moves nothing: the model has no such joint"]
    assert all(line in done.stderr for line in said), "logged too"
    assert "doctor --urdf" in done.stderr


def test_the_source_compares_what_it_delivers(tmp_path: Path) -> None:
    slot, problems = PublishedSlot(), ProblemList()
    source = PublishedSource(slot, (), None, problems)
    source.expect_model(load_bundle(written(tmp_path / "robot", robot(*ARM))))
    left = [1.0, 9.0]

    def deliver(_: Sample) -> None:
        if left:
            slot.put(left.pop(), [Copied("pos", ("elbow", "elbo"), [90.0, 1.0])], {}, kit.now_s())
        else:
            source.end()

    slot.put(8.0, [Copied("pos", ("elbow", "elbo"), [90.0, 1.0])], {}, kit.now_s())
    source.run(deliver, threading.Event())
    assert problems.get_counts() == {
        "pos of 'elbo' moves nothing: the model has no such joint": 1,
        f"{ELBOW}: are these degrees?": 3,
        BACK: 1,
    }


def test_a_profile_says_itself_what_moves_what(tmp_path: Path) -> None:
    profile = parse_profile('[labels]\njoint = ["elbow", "M1"]\n[[fields]]\nname = "pos"\n', "robot.toml")
    slot, problems = PublishedSlot(), ProblemList()
    source = PublishedSource(slot, (), profile, problems)
    source.expect_model(load_bundle(written(tmp_path / "robot", robot(*ARM))))
    slot.put(1.0, [Copied("pos", ("elbow", "M1"), [90.0, 1.0])], {}, kit.now_s())
    source.run(lambda _: source.end(), threading.Event())
    assert problems.get_counts() == {}


# --- the robot's time that a program gives, beside the time that passes


def told(times: list[tuple[float, float]]) -> dict[str, int]:
    problems = ProblemList()
    check = ClockCheck(problems)
    for t_s, now_s in times:
        check.check_time(t_s, now_s)
    return problems.get_counts()


@pytest.mark.parametrize(
    ("pace", "said"),
    [
        (1.0, {}),
        (20.0, {}),  # a replay
        (0.0, {}),
        (1000.0, {"t runs 1,000 times too fast: are these milliseconds?": 3}),
        (1e6, {"t runs 1,000,000 times too fast: are these microseconds?": 3}),
        (1e9, {"t runs 1,000,000,000 times too fast: are these nanoseconds?": 3}),
    ],
)
def test_the_unit_shows_in_the_pace(pace: float, said: dict[str, int]) -> None:
    assert told([(5.0 + pace * tick / 8, 7.0 + tick / 8) for tick in range(25)]) == said


def test_a_clock_that_steps_back_is_told_and_counts_anew() -> None:
    assert told([(10.0, 0.0), (9.5, 0.1), (3.0, 0.2), (3.1, 0.3), (1000.0, 0.4), (1.0, 0.5)]) == {BACK: 2}
