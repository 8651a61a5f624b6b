"""What was started is known by its own word, and ended."""

from __future__ import annotations

import os
import signal
import sys

import pytest
from posecast_command.processes import ENDINGS, Processes, name_program

SLEEP = [sys.executable, "-c", "import time; time.sleep(60)"]


@pytest.mark.parametrize(("word", "found"), [(b"posecast ", True), (b"serving", False)])
def test_a_program_is_there_when_it_says_so(word: bytes, found: bool) -> None:
    with Processes() as processes:
        _, was_written = processes.start_until(name_program("--version"), word, 60.0, os.environ)
    assert was_written is found


def test_all_are_ended() -> None:
    with Processes() as processes:
        flags = ["relay", "run", "--dev", "--port", "0", "--zenoh-listen", "tcp/127.0.0.1:0"]
        relay, serves = processes.start_until(name_program(*flags), b"serving", 60.0, os.environ)
        assert serves
        assert processes.find_ended() is None
    assert relay.poll() == 0


@pytest.mark.parametrize("name", ENDINGS)
def test_a_signal_shows_at_the_next_pause_and_a_second_one_stops_no_ending(name: str) -> None:
    number = getattr(signal, name)
    before = signal.getsignal(number)
    with Processes() as processes:
        signal.raise_signal(number)
        started = processes.start(SLEEP)  # nothing is raised before it is known
        signal.raise_signal(number)
        with pytest.raises(KeyboardInterrupt):
            processes.pause()
    assert started.poll() == -signal.SIGTERM
    assert signal.getsignal(number) == before


def test_a_signal_ends_the_waiting_for_a_word() -> None:
    with Processes() as processes:
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            processes.start_until(SLEEP, b"never", 60.0, os.environ)
