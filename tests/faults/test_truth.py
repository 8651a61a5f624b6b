"""A screen's claims are true: compares its words and poses with the robot's pose at that time."""

from __future__ import annotations

import signal
import time

import pytest
from posecast_testing import free_port, until

from tests.faults.conftest import Scene, Screen, killed, signalled, told
from tests.faults.robot import ROUND_S, hand, told_s
from tests.faults.truth import HOLDING_S, ON_ITS_WAY_S, STALE_S, Stand, lies, stands, steps_back


def test_a_pose_tells_when_it_was_true() -> None:
    for at_s in (0.0, 12.34, ROUND_S / 2, ROUND_S - 0.01, 100 * ROUND_S + 7.5):
        sine, cosine = (round(joint, 3) for joint in hand(at_s))
        for off_s in (0.0, -200.0, 1500.0):
            assert abs(told_s(sine, cosine, at_s + off_s) - at_s) < 0.01


def word(at_s: float, says: str | None, **more: float) -> dict[str, object]:
    return {"at": at_s, "word": says, **more}


def pose(at_s: float, true_at_s: float, **more: float) -> dict[str, object]:
    return {"at": at_s, "pose": hand(true_at_s), **more}


MOVING = [pose(100 + n / 10, 99.95 + n / 10) for n in range(100)]


def test_a_moving_robot_is_live() -> None:
    assert lies([word(99, None), MOVING[0], word(100, "LIVE"), *MOVING[1:]], [], 110) == []


@pytest.mark.parametrize("claim", ["LIVE", "HOLDING"])
def test_an_old_pose_is_a_lie_however_fresh_it_came(claim: str) -> None:
    old = [pose(100 + n / 10, 95 + n / 10) for n in range(3)]
    assert lies([old[0], word(100, claim), *old[1:]], [], 100.2) == [f"{claim} with an old pose, 5.1 s"]


def test_a_pose_that_stays_is_a_lie_when_it_is_too_old() -> None:
    most_s = STALE_S + ON_ITS_WAY_S
    said = [pose(100, 100), word(100, "LIVE")]
    assert lies(said, [], 100 + most_s - 0.1) == []
    assert lies(said, [], 100 + most_s + 0.1) == ["LIVE with an old pose, 2.6 s"]
    assert lies([*said, word(101.5, "STALE")], [], 200) == []


def test_holding_is_true_of_a_robot_that_stood_all_the_time() -> None:
    said = [pose(100, 100), word(100, "LIVE"), word(100 + HOLDING_S, "HOLDING")]
    assert lies(said, [Stand(100, float("inf"))], 200) == []
    assert lies(said, [Stand(100, 190)], 190 + STALE_S) == []
    assert lies(said, [Stand(100, 190)], 200) == ["HOLDING with an old pose, 10.0 s"]


def test_holding_is_a_lie_of_a_robot_that_moved_or_stopped_only_now() -> None:
    said = [pose(100, 100), word(100, "HOLDING")]
    assert lies(said, [], 101) == ["HOLDING while the robot moved, 1.0 s"]
    assert lies(said, [Stand(100, float("inf"))], 101) == ["HOLDING while the robot moved, -inf s"]


def test_nothing_from_before_an_outage_is_claimed_after_it() -> None:
    before, after = pose(100, 99.9), pose(102.2, 102.1)
    said = [before, word(100, "LIVE"), word(101.5, "STALE")]
    assert lies([*said, after, word(102.2, "LIVE")], [], 103) == []
    assert lies([*said, word(102.2, "LIVE"), after], [], 103) == []  # in the same instant
    assert lies([*said, word(102.1, "LIVE"), after], [], 103) == [
        "LIVE again with a pose from before it said otherwise, 2.3 s"
    ]


def test_what_the_screens_own_machine_held_up_is_no_lie() -> None:
    said = [pose(100, 100), word(100, "LIVE")]
    late = {"at": 130.0, "word": "STALE", "held_up_s": 29.5}
    assert lies([*said, late], [], 140) == []
    assert lies([*said, {**late, "held_up_s": 20.0}], [], 140) == ["LIVE with an old pose, 10.0 s"]


def test_a_frame_out_of_order_is_found_by_its_pose() -> None:
    frames = [pose(100 + n / 30, 99.9 + n / 30, seq=n) for n in range(9)]
    assert steps_back(frames) == []
    assert steps_back([*frames[:8], frames[2], frames[8]]) == [
        "seq 2 is 0.2 s older than seq 7, shown before it"
    ]


def test_stands_are_told_by_the_robot() -> None:
    orders = [{"order": what, "at": at} for what, at in (("step", 1), ("stand", 2), ("go", 3), ("stand", 9))]
    assert stands(orders) == [Stand(2, 3), Stand(9, float("inf"))]


def test_a_robot_that_moves_is_live(scene: Scene) -> None:
    _, address, zenoh = scene.stack.relay()
    _, fifo = scene.robot()
    scene.edge(zenoh, fifo)
    screen = scene.screen(address, hz=30)
    screen.says("LIVE")
    began_s = time.monotonic()
    until("longer than it takes to doubt", lambda: time.monotonic() > began_s + 2 * HOLDING_S)
    assert [line["word"] for line in screen.lines("word", began_s)] == []
    screen.never_lied()


def test_moves_and_stands(scene: Scene) -> None:
    """The words for a robot that moves, stands and moves again, without any fault."""
    _, address, zenoh = scene.stack.relay()
    robot, fifo = scene.robot()
    scene.edge(zenoh, fifo)
    screen = scene.screen(address, hz=30)
    screen.says("LIVE")
    screen.watches(60)
    stood_s = told(robot, "stand")
    screen.says("HOLDING", since_s=stood_s)
    went_s = told(robot, "go")
    screen.says("LIVE", since_s=went_s)
    screen.watches(30, since_s=went_s)
    assert [line["word"] for line in screen.lines("word", stood_s)] == ["HOLDING", "LIVE"]
    screen.never_lied()


def test_it_moved_while_nobody_could_see(scene: Scene) -> None:
    """It stands and is HOLDING when the relay freezes. The relay's old data is not passed on as current."""
    relay, address, zenoh = scene.stack.relay()
    robot, fifo = scene.robot()
    scene.edge(zenoh, fifo)
    screen = scene.screen(address, hz=30)
    screen.says("LIVE")
    screen.says("HOLDING", since_s=told(robot, "stand"))
    frozen_s = signalled(relay, signal.SIGSTOP)
    screen.says("STALE", "no connection", frozen_s)
    told(robot, "go")
    until("it has gone far", lambda: time.monotonic() > frozen_s + 2 * STALE_S)
    thawed_s = signalled(relay, signal.SIGCONT)
    screen.says("LIVE", since_s=thawed_s)
    screen.watches(30, since_s=thawed_s)
    assert "HOLDING" not in [line["word"] for line in screen.lines("word", frozen_s)]
    screen.never_lied()


def test_what_it_did_while_nobody_heard_it_is_not_the_present(scene: Scene) -> None:
    """It moves on without its link, falls silent, and the link returns: the relay receives a later pose."""
    _, address, zenoh = scene.stack.relay()
    listen = f"tcp/127.0.0.1:{free_port()}"
    middle = scene.router(listen, zenoh)
    robot, fifo = scene.robot()
    scene.edge(listen, fifo, "--key-interval", "1")
    screen = scene.screen(address, hz=30)
    screen.says("LIVE")
    screen.watches(30)
    cut_s = killed(middle)
    screen.says("OFFLINE", since_s=cut_s)
    until("it has gone on alone", lambda: time.monotonic() > cut_s + 3 * HOLDING_S)
    silent_s = signalled(robot, signal.SIGSTOP)
    until("that is long ago", lambda: time.monotonic() > silent_s + 2 * HOLDING_S)
    scene.router(listen, zenoh)
    screen.says("STALE", "robot silent", silent_s)
    until("the later pose is shown", lambda: told_of(screen) > cut_s + HOLDING_S)
    shown_s = time.monotonic()
    until("a while", lambda: time.monotonic() > shown_s + 2 * STALE_S)
    assert [line["word"] for line in screen.lines("word", silent_s)] == ["STALE"]
    went_on_s = signalled(robot, signal.SIGCONT)
    screen.says("LIVE", since_s=went_on_s)
    screen.watches(30, since_s=went_on_s)
    screen.never_lied()


def told_of(screen: Screen) -> float:
    """When the displayed pose was true."""
    frame = screen.frames()[-1]
    return told_s(frame["pose"][0], frame["pose"][1], frame["at"])
