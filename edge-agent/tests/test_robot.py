"""`posecast.Robot` against a real router: what a program publishes arrives, and nothing of ours harms it."""

from __future__ import annotations

import gc
import logging
import subprocess
import sys
import threading
import tracemalloc
from collections.abc import Callable, Iterator
from itertools import count, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import posecast
import pytest
from edge_stage import PROFILE, ROBOT, Router
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from posecast_edge import kit
from posecast_edge.kit import quote
from posecast_edge.pipeline.inferred_channels import TOO_MANY_FIELDS
from posecast_edge.sources.clock import BACK_A_LITTLE, STANDS
from posecast_testing import count_examples, free_port, until
from posecast_wire.decoder import Decoder
from posecast_wire.frame import FrameError
from posecast_wire.keys import Snapshot

Make = Callable[..., posecast.Robot]
NOWHERE = "tcp/127.0.0.1:1"
SETTLED = {"pos": {"elbow": 0.0, "wrist": 0.0}}


class Watched:
    """What a viewer of the router's robot would see."""

    def __init__(self, router: Router) -> None:
        self._router = router
        self._decoder: Decoder | None = None
        self._read = 0
        self.newest: dict[str, dict[str, float | None]] = {}
        self.t_s = 0.0
        self.seqs: list[int] = []
        self.bits: tuple[str, ...] = ()  # of the flags

    def look(self) -> dict[str, dict[str, float | None]]:
        self._decoder = self._decoder or self._router.decoder()
        frames = self._router.frames
        while self._decoder is not None and self._read < len(frames):
            data = frames[self._read].data
            self._read += 1
            if not self._take(data):  # it may be of another schema
                self._decoder = self._router.decoder()
                self._take(data)
        return self.newest

    def _take(self, data: bytes) -> bool:
        try:
            frame = self._decoder.decode(data) if self._decoder is not None else None
        except FrameError:
            return False
        if frame is not None:
            self.t_s = frame.t_s
            self.seqs.append(frame.seq)
            flags = frame.schema.find_field("flags")
            self.bits = flags.bits if flags else ()
            self.newest = {
                f.name: dict(zip(f.labels, frame.values(f.name), strict=True)) for f in frame.schema.fields
            }
        return frame is not None

    def sees(self, **fields: Any) -> bool:
        return all(
            self.look().get(name) == pytest.approx(values, abs=0.002) for name, values in fields.items()
        )


@pytest.fixture
def make(router: Router) -> Iterator[Make]:
    made: list[posecast.Robot] = []

    def robot(name: str = ROBOT, **arguments: Any) -> posecast.Robot:
        made.append(posecast.Robot(name, **{"relay": router.endpoint, **arguments}))
        return made[-1]

    yield robot
    for each in made:
        each.close()


def publish_until(robot: posecast.Robot, done: Callable[[], bool], **fields: Any) -> None:
    def published() -> bool:
        robot.publish(**fields)
        return done()

    until(f"{fields}: {robot.status()}", published)


# --- what arrives


def test_a_dict_of_joints_arrives(router: Router, make: Make) -> None:
    watched = Watched(router)
    pos, ref = {"elbow": 0.4, "wrist": -0.25}, {"elbow": 0.5, "wrist": np.float32(-0.125)}
    robot = make()
    publish_until(robot, lambda: watched.sees(pos=pos, ref=ref), pos=pos, ref=ref)
    status = robot.status()
    assert status.link in ("on air", "no relay", "waiting")
    assert status.frames > 0
    assert status.problems == {}


def test_an_array_has_the_order_of_the_constructor_and_may_be_changed_afterwards(
    router: Router, make: Make
) -> None:
    joints = ["wrist", "elbow", "shoulder"]
    robot, watched, q = make(joints=joints), Watched(router), np.zeros(3)

    def published() -> bool:
        q[:] = (0.1, 0.2, 0.3)
        robot.publish(pos=q, ref=[1, 2, None])
        q[:] = 9.0
        return watched.sees(pos={"wrist": 0.1, "elbow": 0.2, "shoulder": 0.3})

    until("in order", published)
    assert list(watched.newest["pos"]) == joints
    assert watched.newest["ref"]["shoulder"] is None
    assert robot.status().problems == {}


def test_base_sensors_flags_and_texts_arrive(router: Router, make: Make) -> None:
    robot, watched = make(), Watched(router)
    publish_until(
        robot,
        lambda: watched.sees(
            base={"base.x": 1.0, "base.y": 2.0, "base.z": 0.5},
            baseq={"base.w": 0.6, "base.x": 0.0, "base.y": 0.0, "base.z": 0.8},
            ftf={"wrist.fx": 10.0, "wrist.fy": 0.0, "wrist.fz": -20.0},
            gyro={"imu.x": 0.5, "imu.y": 0.0, "imu.z": 0.0},
            temp={"elbow": 40.0},
            tool={"grip": 7.0},
        ),
        pos={"elbow": 0.1},
        base=np.array([1.0, 2.0, 0.5, 0, 0, 0.8, 0.6]),
        ftf={"wrist": np.array([10.0, 0, -20.0])},
        gyro={"imu.x": 0.5, "imu.y": 0.0, "imu.z": 0.0},
        temp={"elbow": 40},
        tool={"grip": 7.0},
        info={"mode": "walk", "step": 3},
    )

    def texts() -> dict[str, str]:
        sample = router.snapshot()  # None: asked too often
        return {} if sample is None else Snapshot.unpack(sample.payload.to_bytes()).info

    until("texts", lambda: texts() == {"mode": "walk", "step": "3"})
    assert robot.status().problems == {}


def test_parts_of_the_robot_may_come_from_several_threads(router: Router, make: Make) -> None:
    robot, watched = make(), Watched(router)
    stop = threading.Event()

    def say(**fields: Any) -> None:
        while not stop.wait(0.003):
            robot.publish(**fields)

    threads = [
        threading.Thread(target=say, kwargs=fields)
        for fields in ({"pos": {"left": 0.1}}, {"pos": {"right": 0.2}}, {"temp": {"left": 30.0}})
        for _ in range(3)
    ]
    for thread in threads:
        thread.start()
    try:
        until(
            "all parts",
            lambda: watched.sees(pos={"left": 0.1, "right": 0.2}, temp={"left": 30.0, "right": None}),
        )
    finally:
        stop.set()
        for thread in threads:
            thread.join()
    assert robot.status().problems == {}


def test_a_fault_between_two_frames_is_an_event(router: Router, make: Make) -> None:
    robot = make(hz=1)
    publish_until(robot, lambda: len(router.frames) > 0, pos={"elbow": 0.1}, flags={"elbow": []})
    for flags in ([], ["jam"], []):
        for _ in range(3):
            robot.publish(pos={"elbow": 0.1}, flags={"elbow": flags})
    told = [("jam", "on"), ("jam", "off")]
    until("it rose and fell", lambda: [(e["text"], e["state"]) for e in router.events] == told)


def test_robot_time_is_what_the_program_says(router: Router, make: Make) -> None:
    robot, watched = make(), Watched(router)
    publish_until(robot, lambda: bool(watched.look()) and watched.t_s == 12.5, t=12.5, **SETTLED)


NOW_MS = 1_795_899_884_493.75
BAD_TIMES: list[tuple[Any, str]] = [
    (float("nan"), "t is nan, not a number of seconds; the time of arrival counts"),
    ("12.5", "t is '12.5', not a number of seconds; the time of arrival counts"),
]


@pytest.mark.parametrize(("t", "line"), BAD_TIMES, ids=["nan", "text"])
def test_a_time_that_is_none_costs_the_time_only(router: Router, make: Make, t: Any, line: str) -> None:
    robot, watched = make(), Watched(router)
    publish_until(robot, lambda: watched.sees(**SETTLED), t=t, **SETTLED)
    robot.publish(t=float("inf"), pos={"elbow": 0.0})
    assert list(robot.status().problems) == [line]
    assert watched.t_s == pytest.approx(kit.now_s(), abs=30.0)


def test_a_time_in_milliseconds_is_converted_and_said(router: Router, make: Make) -> None:
    robot, watched = make(), Watched(router)
    publish_until(robot, lambda: watched.sees(**SETTLED), t=NOW_MS, **SETTLED)
    assert watched.t_s == pytest.approx(NOW_MS / 1e3, abs=30.0)
    robot.publish(t=NOW_MS - 500, pos={"elbow": 0.0})
    assert set(robot.status().problems) - {STANDS} == {
        f"t is read as milliseconds, because it starts at {NOW_MS:.4g}",
        BACK_A_LITTLE,
    }


class Unprintable(int):
    def __str__(self) -> str:
        raise ValueError


@pytest.mark.parametrize("wrong", [{"base": [0, 0, 1]}, {"base": 7}, {"info": {"n": Unprintable(5)}}])
def test_a_part_that_is_wrong_leaves_the_rest_of_the_call(
    router: Router, make: Make, wrong: dict[str, Any]
) -> None:
    robot, watched = make(), Watched(router)
    publish_until(robot, lambda: watched.sees(**SETTLED), **wrong, **SETTLED)


def test_a_profile_gives_lists_their_order(router: Router, make: Make, profile_file: Path) -> None:
    robot, watched = make(profile=profile_file), Watched(router)
    publish_until(robot, lambda: watched.sees(pos={"RKN": 0.1, "LKN": 0.2}), pos=[0.1, 0.2], flags=[1, 2])
    robot.publish(pos={"RKN": 0.1, "toe": 1.0}, cur={"RKN": 1.0})
    problems = ("pos of 'toe' is left out: it is not in the profile",)
    until("named", lambda: all(p in robot.status().problems for p in problems))
    assert PROFILE.startswith("\n[robot]")


def test_of_what_the_profile_lacks_only_that_is_said(make: Make, profile_file: Path) -> None:
    """Not that its values are wrong: they may be right."""
    robot = make(profile=profile_file)
    robot.publish(
        pos={"RKN": 0.1},
        diag={"arm": ["warn"]},
        status={"RKN": ["ready"]},  # type: ignore[dict-item]
        temp=[1.0, 2.0, 3.0],
        base=[0, 0, 0, 0, 0, 0, 1],
        position={"RKN": 0.1},
    )
    left_out = ("diag", "status", "temp", "base", "baseq", "position")
    assert robot.status().problems == {
        f"{name} is left out: it is not in the profile"
        + ("; did you mean pos=?" if name == "position" else ""): 1
        for name in left_out
    }


def test_two_robots_in_one_process(router: Router, make: Make) -> None:
    one, other = make("one"), make("other")

    def published() -> bool:
        one.publish(pos={"a": 1.0})
        other.publish(pos={"b": 2.0})
        keys = {frame.key for frame in router.frames}
        return {key.split("/")[2] for key in keys} == {"one", "other"}

    until("both are heard", published)
    one.close()
    before = other.status().frames
    publish_until(other, lambda: other.status().frames > before + 3, pos={"b": 3.0})
    assert one.status().link == "closed"


def test_what_is_published_after_the_relay_restarted_arrives(router: Router, make: Make) -> None:
    robot = make()
    publish_until(robot, lambda: len(router.frames) > 3, **SETTLED)
    router.stop()
    until("noticed", lambda: robot.status().link.startswith("no link"))
    router.frames.clear()
    router.start()
    watched, pose = Watched(router), {"elbow": 0.7, "wrist": 0.0}
    publish_until(robot, lambda: watched.sees(pos=pose), pos=pose)


def test_the_last_pose_leaves_with_close(router: Router, make: Make) -> None:
    watched = Watched(router)
    with make(hz=2) as robot:
        publish_until(robot, lambda: bool(watched.look()), **SETTLED)
        robot.publish(pos={"elbow": 0.9, "wrist": 0.0})
    until("the last one", lambda: watched.sees(pos={"elbow": 0.9, "wrist": 0.0}))


# --- what is wrong


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"pos": {"elbow": "0.4"}}, "pos of 'elbow' is '0.4', not a number"),
    ({"pos": {"elbow": True}}, "pos of 'elbow' is of type bool, not a number"),
    ({"pos": {"elbow": float("nan")}}, "pos of 'elbow' is nan, which is not a reading"),
    ({"pos": {"elbow": float("inf")}}, "pos of 'elbow' is inf, which is not a reading"),
    ({"pos": {"elbwo": 0.4}}, "pos of 'elbwo' is left out: it is not in joints=[…]"),
    ({"pos": {7: 0.4}}, "pos has the name 7, which is not a valid string"),
    ({"pos": [0.1]}, "pos has 1 value, not 2"),
    ({"pos": np.zeros((2, 2))}, "pos has the shape (2, 2), not (2,)"),
    ({"pos": 0.4}, "pos is of type float: give a dict by name, a list or an array"),
    ({"ftf": [1.0]}, "ftf is a list without names: give joints=[…], or use a dict by name"),
    ({"ftf": {"wrist": (1.0,)}}, "ftf of 'wrist': give 3 numbers, fx, fy, fz"),
    ({"base": [1, 2, 3]}, "base: give 7 numbers, x, y, z in metres and a quaternion x, y, z, w"),
    ({"flags": {"elbow": "jam"}}, "flags of 'elbow' is 'jam', not a mask or a list of names"),
    ({"torque": {"elbow": 1.0}}, "torque becomes a plain table; did you mean effort=?"),
    ({"info": {"mode": [1]}}, "info 'mode' is not a text"),
    ({"no name": {"a": 1}}, "'no name' is not a field name"),
]


def counts(robot: posecast.Robot, told: str, above: int) -> Callable[[], bool]:
    return lambda: robot.status().problems.get(told, 0) > above


def test_one_name_that_is_none_costs_that_name_only(router: Router, make: Make) -> None:
    robot, watched = make(), Watched(router)
    bad: dict[str, Any] = {"": 0.4, "a\nb": 0.5, "x" * 201: 0.6}
    publish_until(robot, lambda: watched.sees(pos={"elbow": 0.1}), pos={"elbow": 0.1, **bad})
    assert [text.partition(": ")[0] for text in robot.status().problems] == [
        f"pos of {quote(name)} is left out" for name in bad
    ]


def test_each_mistake_is_named_once_and_counted(
    router: Router, make: Make, caplog: pytest.LogCaptureFixture
) -> None:
    robot, watched = make(joints=["elbow", "wrist"]), Watched(router)
    publish_until(robot, lambda: bool(watched.look()), **SETTLED)
    with caplog.at_level(logging.WARNING, "posecast_edge.robot"):
        for _ in range(2):
            for fields, told in WRONG:
                before = robot.status().problems.get(told, 0)
                publish_until(robot, counts(robot, told, before), **fields)
        robot.publish({"elbow": 1.0})  # type: ignore[arg-type]
        named = "publish() takes keyword arguments only: publish(pos=…)"
        assert robot.status().problems[named] == 1
        said = [told for _, told in WRONG] + [named]
        until("all in the log", lambda: {r.getMessage() for r in caplog.records} >= set(said))
    assert sorted(r.getMessage() for r in caplog.records if r.getMessage() in said) == sorted(said)
    publish_until(robot, lambda: watched.sees(pos={"elbow": 0.3, "wrist": 0.3}), pos=[0.3, 0.3])


class Evil:
    """Raises whatever one does with it."""

    def __getattribute__(self, name: str) -> Any:
        raise ZeroDivisionError(name)

    def __len__(self) -> int:
        raise ZeroDivisionError

    def __iter__(self) -> Any:
        raise ZeroDivisionError


class Endless:
    def __len__(self) -> int:
        return 2

    def __iter__(self) -> Iterator[float]:
        while True:
            yield 1.0


THINGS = [Evil(), Endless(), 10**400, np.array(1.0), np.array([True, False]), object(), np.zeros((2, 2))]
LEAVES = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=4), st.binary(max_size=3),
    st.complex_numbers(), st.integers(0, len(THINGS) - 1).map(THINGS.__getitem__),
)  # fmt: skip
JUNK = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.tuples(inner, inner),
        st.dictionaries(
            st.one_of(st.text(max_size=4), st.integers(), st.sampled_from(["elbow", "\ud800"])),
            inner,
            max_size=3,
        ),
    ),
    max_leaves=6,
)
NAMES = st.sampled_from(
    ["pos", "ref", "flags", "base", "ftf", "quat", "info", "t", "temp", "diag", "else", "no name"]
)


@settings(
    max_examples=count_examples(150),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(calls=st.lists(st.dictionaries(NAMES, JUNK, max_size=4), max_size=4), last=JUNK)
def test_nothing_that_is_published_raises(junk_robot: posecast.Robot, calls: Any, last: Any) -> None:
    for fields in calls:
        junk_robot.publish(**fields)
    junk_robot.publish(last)
    assert len(junk_robot.status().problems) <= 51


@pytest.fixture(scope="module")
def junk_robot() -> Iterator[posecast.Robot]:
    """Of which the right thing arrives in the end, too."""
    relay = Router()
    relay.start()
    robot = posecast.Robot(ROBOT, relay=relay.endpoint, joints=["elbow", "wrist"])
    try:
        yield robot
        watched = Watched(relay)
        publish_until(robot, lambda: watched.sees(pos={"elbow": 0.5, "wrist": 0.5}), pos=[0.5, 0.5])
    finally:
        robot.close()
        relay.stop()


def constructor_error(**arguments: Any) -> str:
    with pytest.raises(ValueError, match=r"\A[^\n]+\Z") as raised:
        posecast.Robot(**{"name": ROBOT, "relay": NOWHERE, **arguments})
    return str(raised.value)


def test_the_constructor_names_what_is_plainly_wrong(tmp_path: Path, profile_file: Path) -> None:
    (tmp_path / "bad.urdf").write_text("<robot", encoding="utf-8")
    (tmp_path / "open").write_text("posecast1:x:y", encoding="utf-8")
    (tmp_path / "open").chmod(0o644)
    assert constructor_error(name="My Arm").startswith("robot 'My Arm': use 1 to 63")
    assert constructor_error(name=7) == "name: 7 is not a string"
    assert (
        constructor_error(relay="127.0.0.1")
        == "relay: '127.0.0.1' is not an endpoint such as tcp/127.0.0.1:7447"
    )
    assert constructor_error(relay=None) == "relay: None is not a string"
    assert constructor_error(hz=0) == "hz: 0 is not a number from 1 to 60"
    assert constructor_error(hz="30") == "hz: '30' is not a number from 1 to 60"
    assert constructor_error(joints="elbow") == "joints: 'elbow' is not a list of names"
    assert constructor_error(joints=["a", "a"]) == "joints: 'a' is listed twice"
    assert constructor_error(joints=[1]) == "joints: 1 is not a name"
    assert constructor_error(joints=["toe"], profile=profile_file) == "joints: the profile has no joint 'toe'"
    assert "No such file" in constructor_error(urdf=tmp_path / "none.urdf")
    assert constructor_error(urdf=tmp_path / "bad.urdf").startswith(f"urdf: {tmp_path / 'bad.urdf'}: ")
    assert "not a built model" in constructor_error(model=tmp_path)
    assert constructor_error(urdf="a", model="b") == "urdf and model: give one, not both"
    assert "profile: nope" in constructor_error(profile="nope")
    assert "chmod 600" in constructor_error(credential=tmp_path / "open")


def test_joints_that_the_model_lacks_are_named(router: Router, make: Make) -> None:
    from posecast_edge.sources.mujoco.source import ARM

    robot = make(urdf=ARM)
    told = "pos of 'elbwo' moves nothing: the model has no such joint"
    publish_until(robot, lambda: told in robot.status().problems, pos={"elbwo": 0.1})
    until("the model is served", lambda: bool(router.get(f"posecast/v1/{ROBOT}/model/manifest")))


def test_a_sound_model_has_no_problems_without_the_mesh_tools_either(
    router: Router, make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    from posecast_edge.sources.mujoco.source import ARM

    monkeypatch.setattr("posecast_edge.model.serve.background.can_build", lambda: False)
    robot, watched = make(urdf=ARM), Watched(router)
    publish_until(robot, lambda: watched.sees(**SETTLED), **SETTLED)
    assert robot.status().problems == {}


# --- how long it lives


def test_memory_is_bounded_while_the_relay_is_away(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("posecast_edge.pipeline.inferred_channels.FIELDS_MAX", 32)
    joints = [f"joint_{i}" for i in range(30)]
    with posecast.Robot(ROBOT, relay=NOWHERE, joints=joints) as robot:
        fill, numbers = np.zeros(30), count()

        def publish(times: int) -> None:
            for i in islice(numbers, times):
                flags = {"joint_0": ["jam"] if i % 2 else []}
                robot.publish(pos=fill, flags=flags, info={"mode": str(i)})
                kind: Any = {f"kind{i}": {"a": 1.0}}
                robot.publish(**kind)

        tracemalloc.start()
        try:
            publish(1000)

            def full() -> bool:
                publish(10)
                return TOO_MANY_FIELDS in robot.status().problems

            until("all that is remembered is full", full)
            publish(1000)
            before = tracemalloc.get_traced_memory()[0]
            publish(4000)
            # 8,000 calls that were kept would be over 2 MB
            assert tracemalloc.get_traced_memory()[0] - before < 400_000
        finally:
            tracemalloc.stop()


def test_close_while_others_publish(make: Make) -> None:
    robot, stop = make(), threading.Event()
    failed: list[BaseException] = []

    def say() -> None:
        try:
            while not stop.is_set():
                robot.publish(pos={"elbow": 0.1})
        except BaseException as e:
            failed.append(e)

    threads = [threading.Thread(target=say) for _ in range(4)]
    for thread in threads:
        thread.start()
    until("they publish", lambda: robot.status().published > 100)
    for _ in range(2):
        robot.close()
    stop.set()
    for thread in threads:
        thread.join()
    robot.publish(pos={"elbow": 0.1})
    assert failed == []
    assert robot.status().link == "closed"
    assert "publish() after close() has no effect" in robot.status().problems


def test_a_robot_that_nobody_holds_leaves(router: Router) -> None:
    before = set(threading.enumerate())
    robot = posecast.Robot(ROBOT, relay=router.endpoint)
    publish_until(robot, lambda: len(router.frames) > 1, **SETTLED)
    threads = set(threading.enumerate()) - before
    assert {t.name for t in threads} >= {"posecast", "source", "link"}
    del robot
    gc.collect()
    until("its threads have ended", lambda: not any(t.is_alive() for t in threads))


PROGRAM = """
import os, sys, time, posecast
robot = posecast.Robot("r1", relay=sys.argv[1])
while robot.status().frames < 3 and "away" not in sys.argv:
    robot.publish(pos={"elbow": 0.1})
    time.sleep(0.01)
"""
FORK = """
pid = os.fork()
if pid == 0:
    robot.publish(pos={"elbow": 0.2})
    robot.close()
    try:
        posecast.Robot("r2", relay=sys.argv[1])
    except RuntimeError as e:
        print(str(e)[:23], robot.status().link)
    sys.exit(5)
print(os.waitpid(pid, 0)[1] >> 8)
before = robot.status().frames
while robot.status().frames < before + 3:
    robot.publish(pos={"elbow": 0.3})
    time.sleep(0.01)
"""


@pytest.mark.parametrize(
    ("end", "where", "status", "said"),
    [
        ("", "here", 0, ""),
        ("sys.exit(3)", "here", 3, ""),
        ("raise SystemError", "here", 1, ""),
        ("", "away", 0, ""),
        (FORK, "here", 0, "this process was forked closed\n5\n"),
    ],
)
def test_a_program_ends_as_it_would_without(
    router: Router, end: str, where: str, status: int, said: str
) -> None:
    relay = router.endpoint if where == "here" else f"tcp/127.0.0.1:{free_port()}"
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM + end, relay, where],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stdout) == (status, said), done.stderr
    assert "Fatal" not in done.stderr
    assert "panicked" not in done.stderr


def test_nothing_is_printed_and_no_logger_is_set_up(router: Router) -> None:
    program = PROGRAM + "import logging; assert not logging.getLogger().handlers; robot.close()"
    done = subprocess.run(
        [sys.executable, "-c", program, router.endpoint, "here"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


if TYPE_CHECKING:  # `make check` finds what an author does wrong: an ignored error that is none would be one

    def is_typed(robot: posecast.Robot) -> None:
        robot.publish(pos={"a": 1.0}, ref=[1.0], base=(0, 0, 0, 0, 0, 0, 1), tool={"x": 1})
        robot.publish({"a": 1.0})  # type: ignore[arg-type]
        robot.publish(pos="a")  # type: ignore[arg-type]
        robot.status().problems.items()
