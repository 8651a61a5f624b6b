from __future__ import annotations

from posecast_edge.kit import ExceptionLog


def test_a_callback_that_raises_is_counted_and_said_once() -> None:
    said: list[str] = []
    exceptions = ExceptionLog(said.append)

    def read(text: str) -> None:
        int(text)

    call = exceptions.guard("a snapshot", read)
    for _ in range(1000):
        call("nonsense\u202e")
    call("5")
    assert exceptions.count("a snapshot") == 1000
    assert exceptions.count("the link") == 0
    assert said == ["a snapshot: ValueError: invalid literal for int() with base 10: 'nonsense\\u202e'"]
