"""What was started is known by its own word, and ended."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import pytest
from posecast_command.processes import ENDINGS, Processes


@pytest.fixture(autouse=True)
def signals_as_before() -> Iterator[None]:
    before = {name: signal.getsignal(getattr(signal, name)) for name in ENDINGS}
    yield
    for name, handler in before.items():
        signal.signal(getattr(signal, name), handler)


@pytest.mark.parametrize(("word", "found"), [(b"posecast ", True), (b"serving", False)])
def test_a_program_is_there_when_it_says_so(word: bytes, found: bool) -> None:
    with Processes() as processes:
        _, said = processes.start_until(["--version"], word, 60.0, os.environ)
    assert said is found


def test_all_are_ended() -> None:
    with Processes() as processes:
        flags = ["relay", "run", "--dev", "--port", "0", "--zenoh-listen", "tcp/127.0.0.1:0"]
        relay, serves = processes.start_until(flags, b"serving", 60.0, os.environ)
        assert serves
        assert processes.find_ended() is None
    assert relay.poll() == 0
