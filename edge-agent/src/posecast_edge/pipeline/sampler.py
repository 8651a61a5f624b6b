"""The newest sample at the sampling rate, as codes. Pure: time comes in as an argument."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from posecast_wire.quantiser import Quantiser

Values = Sequence[float | None] | Callable[[], Sequence[float | None]]
CONFIRM_S = 0.5  # an unchanged robot says so this often
NEVER = float("-inf")


@dataclass(frozen=True)
class Due:
    """A frame to encode: codes in channel order, the robot's clock, whether it must be a KEY, and when its
    sample was taken."""

    codes: list[int]
    t_s: float
    force_key: bool
    taken_s: float


class LeftOver(NamedTuple):
    """A sample that was never sent. `number`: which of all."""

    number: int
    t_s: float
    values: Sequence[float | None]


class Sampler:
    """Holds one sample: the newest. A source faster than the ticks loses samples here, and only here.

    `offer` and `force_key` may be called from other threads than `tick`.
    """

    def __init__(self, quantiser: Quantiser) -> None:
        self._quantiser = quantiser
        # Other threads only replace these two, ticks remember which they have seen: nothing needs a lock.
        self._newest: tuple[int, float, Values, float] = (0, 0.0, (), NEVER)
        self._force = 1
        self._seen_sample = self._sent_sample = 0
        self._seen_force = 0
        self._codes: list[int] | None = None  # of the last frame
        self._sent_s = 0.0

    def offer(self, t_s: float, values: Values, taken_s: float) -> None:
        """A sample: values in channel order, or what gives them; robot time in seconds; when it was taken
        from the source. It replaces the one before."""
        self._newest = (self._newest[0] + 1, t_s, values, taken_s)

    @property
    def fresh(self) -> bool:
        """A sample waits that no frame has carried."""
        return self._newest[0] != self._seen_sample

    def find_unsent(self, oldest_s: float) -> LeftOver | None:
        """The newest sample, when no frame has carried it and it was taken before `oldest_s`."""
        number, t_s, values, taken_s = self._newest
        if number == self._sent_sample or taken_s >= oldest_s:
            return None
        return LeftOver(number, t_s, values() if callable(values) else values)

    def skip_sample(self) -> None:
        """The newest sample can't be sent: wait for the next."""
        self._seen_sample = self._newest[0]

    def force_key(self) -> None:
        """The next frame is a KEY and goes out even when nothing changed (if the source delivers)."""
        self._force += 1

    def tick(self, now_s: float, oldest_s: float = NEVER) -> Due | None:
        """What is to be sent now: nothing without a new sample, nothing while the codes stand still, except
        that an unchanged robot is confirmed every CONFIRM_S. Time and sequence never count as a change.

        A sample that was taken before `oldest_s` is not sent any more: who saw it come would take it for new.
        """
        number, t_s, values, taken_s = self._newest
        force = self._force
        if number == self._seen_sample:
            return None
        if taken_s < oldest_s:
            self._seen_sample = number
            return None
        codes = self._quantiser.quantise(values() if callable(values) else values)
        force_key = force != self._seen_force
        if not force_key and codes == self._codes and now_s - self._sent_s < CONFIRM_S:
            return None
        self._seen_sample = self._sent_sample = number
        self._seen_force = force
        self._codes, self._sent_s = codes, now_s
        return Due(codes, t_s, force_key, taken_s)
