"""Keeps the newest sample and hands it out as codes at the sampling rate. Does no I/O; time is an
argument."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from posecast_wire.quantiser import Quantiser

Values = Sequence[float | None] | Callable[[], Sequence[float | None]]
CONFIRM_S = 0.5  # how often unchanged codes are sent again
NEVER = float("-inf")


@dataclass(frozen=True)
class Due:
    """A frame to encode. `codes`: all channels in the schema's order; `t_s`: robot clock; `force_key`: the
    frame must be a KEY; `taken_s`: when the sample was read from the source. Times are seconds."""

    codes: list[int]
    t_s: float
    force_key: bool
    taken_s: float


class LeftOver(NamedTuple):
    """A sample that was never sent. `number`: its position among all samples."""

    number: int
    t_s: float
    values: Sequence[float | None]


class Sampler:
    """Holds only the newest sample. This is the only place where samples of a source faster than the ticks
    are dropped.

    `offer` and `force_key` may be called from other threads than `tick`.
    """

    def __init__(self, quantiser: Quantiser) -> None:
        self._quantiser = quantiser
        # Other threads only replace these two, and ticks remember which they have seen, so no lock is needed.
        self._newest: tuple[int, float, Values, float] = (0, 0.0, (), NEVER)
        self._force = 1
        self._seen_sample = self._sent_sample = 0
        self._seen_force = 0
        self._codes: list[int] | None = None  # of the last frame
        self._sent_s = 0.0

    def offer(self, t_s: float, values: Values, taken_s: float) -> None:
        """Replace the held sample. `values`: in channel order, or a function that returns them; `t_s`: robot
        time, and `taken_s`: when it came from the source, both in seconds."""
        self._newest = (self._newest[0] + 1, t_s, values, taken_s)

    @property
    def fresh(self) -> bool:
        """Whether the newest sample has not been sent yet."""
        return self._newest[0] != self._seen_sample

    def find_unsent(self, oldest_s: float) -> LeftOver | None:
        """The newest sample, if it was never sent and was taken before `oldest_s`; otherwise None."""
        number, t_s, values, taken_s = self._newest
        if number == self._sent_sample or taken_s >= oldest_s:
            return None
        return LeftOver(number, t_s, values() if callable(values) else values)

    def skip_sample(self) -> None:
        """Drop the newest sample, which can't be sent, and wait for the next."""
        self._seen_sample = self._newest[0]

    def force_key(self) -> None:
        """Make the next frame a KEY and send it even if nothing has changed, provided the source still
        delivers samples."""
        self._force += 1

    def tick(self, now_s: float, oldest_s: float = NEVER) -> Due | None:
        """What to send now. None without a new sample or while the codes do not change; unchanged codes are
        still sent every CONFIRM_S. Time and sequence number are not compared.

        A sample taken before `oldest_s` is not sent, because viewers would mistake it for a new one.
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
