"""What the log says of a server that comes and goes."""

from __future__ import annotations

from posecast_relay.kit import CALM_S, OutageLog


def test_a_server_that_is_late_again_and_again_is_one_trouble() -> None:
    log, said = OutageLog(), []
    for at in range(7):  # twice in 7 s, as on a busy machine
        if at in (0, 6):
            said.append(log.note_failure(TimeoutError(), at))
        else:
            assert not log.note_success(at)
    assert said == ["TimeoutError", None]
    assert not log.note_success(6 + CALM_S - 0.1)
    assert log.is_open
    assert log.note_success(6 + CALM_S)
    assert not log.is_open
    assert not log.note_success(7 + CALM_S), "that it is over is said once"


def test_another_reason_and_another_trouble_are_said() -> None:
    log = OutageLog()
    assert log.note_failure(TimeoutError(), 0.0) == "TimeoutError"
    assert log.note_failure(ConnectionError("refused"), 1.0) == "refused"
    assert log.note_failure(ConnectionError("reset"), 2.0) is None
    assert log.note_success(2.0 + CALM_S)
    assert log.note_failure(TimeoutError(), 100.0) == "TimeoutError"


def test_without_a_failure_there_is_nothing_to_say() -> None:
    assert not OutageLog().note_success(1e9)
