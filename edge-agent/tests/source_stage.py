"""A source at work in this process, and what feeds it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from posecast_edge.profile.reader import parse_profile
from posecast_edge.sample import Sample
from posecast_edge.sources.base import Discovering
from posecast_edge.sources.registry import open_source
from posecast_testing import until


class Listening:
    """A source at work, and what it has delivered."""

    def __init__(self, spec: str, profile: str | None) -> None:
        source = open_source(spec, parse_profile(profile) if profile else None)
        assert isinstance(source, Discovering)
        self.source = source
        self.samples: list[Sample] = []
        self.urdfs: list[str] = []
        self.source.send_urdf_to(self.urdfs.append)
        self.stop = threading.Event()
        self.thread = threading.Thread(
            target=self.source.run, args=(self.samples.append, self.stop), daemon=True
        )
        self.thread.start()

    @property
    def newest(self) -> Any:
        return self.samples[-1].values if self.samples else {}

    @property
    def last(self) -> tuple[float, Any]:
        """Time and values of one sample."""
        sample = self.samples[-1]
        return sample.t_s, sample.values

    def end(self) -> None:
        self.stop.set()
        self.thread.join(5)
        assert not self.thread.is_alive()


class Mover:
    """Calls something `hz` times a second, with the seconds since it began, until it is ended."""

    def __init__(self, hz: float, act: Callable[[float], None]) -> None:
        self._ended = threading.Event()
        self._hz, self._act = hz, act
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        began_s = time.monotonic()
        k = 0
        while not self._ended.wait(max(0.0, began_s + k / self._hz - time.monotonic())):
            self._act(k / self._hz)
            k += 1

    def end(self) -> None:
        self._ended.set()
        self._thread.join()


def flood(publish: Callable[[float], None], heard: Listening) -> list[float]:
    """Publish stamps (s) as fast as it goes until over 50 samples have come; all that were published."""
    ended = threading.Event()
    stamps_s = [0.0]

    def go_on() -> None:
        while not ended.is_set():
            stamps_s.append(time.monotonic())
            publish(stamps_s[-1])

    publisher = threading.Thread(target=go_on)
    publisher.start()
    try:
        until("samples", lambda: len(heard.samples) > 50, 20)
    finally:
        ended.set()
        publisher.join()
    return stamps_s


Listen = Callable[..., Listening]
Move = Callable[..., Mover]


@pytest.fixture
def listen() -> Iterator[Listen]:
    """`listen(spec, profile)`: a source that listens until the test ends."""
    started: list[Listening] = []

    def start(spec: str, profile: str | None) -> Listening:
        started.append(Listening(spec, profile))
        return started[-1]

    yield start
    for one in started:
        one.end()


@pytest.fixture
def moving() -> Iterator[Move]:
    """`moving(hz, act)`: what goes on until the test ends."""
    movers: list[Mover] = []

    def start(hz: float, act: Callable[[float], None]) -> Mover:
        movers.append(Mover(hz, act))
        return movers[-1]

    yield start
    for mover in movers:
        mover.end()
