"""What a program publishes beside its robot's model, with and without the mesh tools."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from command_stage import run_edge
from model_stage import joint, link, mesh, robot, written
from posecast_edge import kit
from posecast_edge.model.serve.bundle import load_bundle
from posecast_edge.profile.reader import parse_profile
from posecast_edge.sample import Sample
from posecast_edge.sources.clock import BACK, BACK_A_LITTLE, STANDS, ClockCheck, StepCheck
from posecast_edge.sources.published.checks import (
    ERRORS_MAX,
    ModelCheck,
    ProblemList,
    explain_stillness,
)
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
    "mesh 'meshes/gone.stl' of link 'a': no such file; looked for 'meshes/gone.stl' and any 'gone.stl' "
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
    assert said[3] == "pos of 'elbo' moves nothing: the model has no such joint"
    assert all(line in done.stderr for line in said[:4]), "logged too"
    assert [line.partition(":")[0] for line in said[4:]] == ["no channel moves the model"]
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


# --- none of the names is a joint's

SOURCES = {
    "joints": (["elbow", "extend"], ""),
    "one joint": (["elbow", "x"], ""),
    "variables of a planar joint": (["rest/x"], ""),
    "nothing": ([], ""),
    "a prefix": (["r1/elbow", "r1/extend"], "; the names of the channels begin with 'r1/'"),
    "a prefix and others": (
        ["arm_elbow", "arm_extend", "grip"],
        "; the names of the channels begin with 'arm_'",
    ),
    "two robots": (
        ["r1/elbow", "r1/extend", "r2/elbow", "r2/extend"],
        "; the names of the channels begin with 'r1/'",
    ),
    "a suffix": (["elbow.pos", "extend.pos"], "; the names of the channels end with '.pos'"),
    "one suffix": (["elbow_joint"], "; the names of the channels end with '_joint'"),
    "a model with a prefix": (["bow", "tend"], ""),
    "other letters": (["Elbow", "Extend"], ""),
    "units": (["elbow (deg)", "extend (deg)"], "; the names of the channels end with ' (deg)'"),
    "numbers": ([f"joint{i}" for i in range(500)], ""),
    "a control character": (["elbow\t"], "; the names of the channels end with '\\t'"),
    "a long name": (["elbow" * 40], ""),
}
MOVING = ("joints", "one joint", "variables of a planar joint", "nothing")


@pytest.mark.parametrize("case", SOURCES)
def test_a_source_whose_names_move_nothing(case: str, tmp_path: Path) -> None:
    labels, hint = SOURCES[case]
    bundle = load_bundle(written(tmp_path / "robot", robot(*ARM)))
    text = explain_stillness(labels, bundle.readings, [joint.name for joint in bundle.joints])
    if case in MOVING:
        assert text == ""
        return
    assert text.startswith("no channel moves the model: the source sends '")
    assert f", the model's joints are 'elbow', 'extend'{hint}; use the same" in text
    assert text.endswith("; use the same names, or map them in a profile's [joints]")
    assert text.isprintable()
    assert len(text) < 400


def test_a_model_whose_names_have_a_prefix() -> None:
    joints = ["panda_1", "panda_2", "panda_3"]
    text = explain_stillness(["1", "2", "3"], set(joints), joints)
    assert "; the names of the model's joints begin with 'panda_';" in text
    assert explain_stillness(["a"], set(), []) == "", "a model that does not move"


REST = "model: no channel for 'extend': at rest"


@pytest.mark.parametrize(
    ("labels", "profile", "lines"),
    [
        (["elbow", "extend", "rest/x"], "", []),
        (["elbow", "other"], "", [REST]),
        (["r1/elbow", "r1/extend"], "", [SOURCES["a prefix"][1]]),
        ([], "", []),  # an IMU, for example
        (["M1"], "[joints]\nelbow.terms = [['M1', 1.0]]\n", [REST]),
        (["M1"], "[joints]\nelbo.terms = [['M1', 1.0]]\n", ["sends 'M1', 'elbo', the model's joints are"]),
    ],
)
def test_run_says_that_nothing_moves(
    labels: list[str], profile: str, lines: list[str], tmp_path: Path
) -> None:
    urdf = written(tmp_path / "robot", robot(*ARM))
    log = tmp_path / "log.jsonl"
    values = {"pos": dict.fromkeys(labels, 0.1)} if labels else {"acc": {"imu.x": 1.0}}
    log.write_text("".join(json.dumps({"t": k / 100, **values}) + "\n" for k in range(3)))
    flags = []
    if profile:
        toml = tmp_path / "robot.toml"
        toml.write_text(f'[labels]\njoint = ["M1"]\n[[fields]]\nname = "pos"\n{profile}')
        flags = [f"--profile={toml}"]
    done = run_edge(
        "run", "--robot=r", f"--source=jsonl:{log}", "--relay=tcp/127.0.0.1:1", f"--urdf={urdf}", *flags
    )
    assert done.returncode == 0, done.stderr
    said = [line for line in done.stderr.splitlines() if "no channel" in line]
    assert len(said) == len(lines)
    assert all(part in line for part, line in zip(lines, said, strict=True))


def test_many_names_are_compared_in_no_time() -> None:
    names = [f"robot/{'x' * 150}{i}" for i in range(4096)]
    assert explain_stillness(names, {"j"}, [f"{'x' * 150}{i}" for i in range(1000)])


# --- the robot's time that a program gives, beside the time that passes


def told(times: list[tuple[float, float]]) -> dict[str, int]:
    problems = ProblemList()
    check = ClockCheck(problems.add)
    for t_s, now_s in times:
        check.check_time(t_s, now_s)
    return problems.get_counts()


@pytest.mark.parametrize(
    ("pace", "said"),
    [
        (1.0, {}),
        (20.0, {}),  # a replay
        (0.0, {STANDS: 9}),
        (1000.0, {"t runs 1,000 times too fast: are these milliseconds?": 3}),
        (1e6, {"t runs 1,000,000 times too fast: are these microseconds?": 3}),
        (1e9, {"t runs 1,000,000,000 times too fast: are these nanoseconds?": 3}),
    ],
)
def test_the_unit_shows_in_the_pace(pace: float, said: dict[str, int]) -> None:
    assert told([(5.0 + pace * tick / 8, 7.0 + tick / 8) for tick in range(25)]) == said


def test_a_clock_that_steps_back_is_told_and_counts_anew() -> None:
    assert told([(10.0, 0.0), (9.5, 0.1), (3.0, 0.2), (3.1, 0.3), (1000.0, 0.4), (1.0, 0.5)]) == {BACK: 2}


@pytest.mark.parametrize("length", [0.1, 0.3, 0.5, 0.9, 1.0, 1.5])
@pytest.mark.parametrize("hz", [10, 200])
def test_short_episodes_step_back(length: float, hz: int) -> None:
    """Each episode of a simulation begins at 0. A program that publishes at two places has two clocks."""
    problems = ProblemList()
    clock, steps = ClockCheck(problems.add), StepCheck(problems.add)
    per_episode = round(length * hz)
    for k in range(5 * per_episode):
        t_s = k % per_episode / hz
        clock.check_time(t_s, k / hz)
        steps.check_step(("pos",), t_s)
        steps.check_step(("acc", "gyro"), 100 + k / hz - 0.01)
    said = {text: count for text, count in problems.get_counts().items() if text != STANDS}
    assert said == ({} if per_episode < 2 else {BACK if (per_episode - 1) / hz > 1 else BACK_A_LITTLE: 4})


def test_threads_have_clocks_of_their_own() -> None:
    problems = ProblemList()
    steps = StepCheck(problems.add)
    steps.check_step(("pos",), 10.0)

    def publish() -> None:
        for k in range(9):
            steps.check_step(("pos",), 9.5 + k / 100)

    other = threading.Thread(target=publish)
    other.start()
    other.join()
    steps.check_step(("pos",), 10.01)
    assert problems.get_counts() == {}
