"""The newest sample at the sampling rate, as codes. Pure: time comes in as an argument."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from posecast_wire.quantiser import Quantiser

Values = Sequence[float | None] | Callable[[], Sequence[float | None]]
CONFIRM_S = 0.5  # an unchanged robot says so this often


@dataclass(frozen=True)
class Due:
    """A frame to encode: codes in channel order, the robot's clock, and whether it must be a KEY."""

    codes: list[int]
    t_s: float
    force_key: bool


class Sampler:
    """Holds one sample: the newest. A source faster than the ticks loses samples here, and only here.

    `offer` and `force_key` may be called from other threads than `tick`.
    """

    def __init__(self, quantiser: Quantiser) -> None:
        self._quantiser = quantiser
        # Other threads only replace these two, ticks remember which they have seen: nothing needs a lock.
        self._newest: tuple[int, float, Values] = (0, 0.0, ())
        self._force = 1
        self._seen_sample = 0
        self._seen_force = 0
        self._codes: list[int] | None = None  # of the last frame
        self._sent_s = 0.0

    def offer(self, t_s: float, values: Values) -> None:
        """A sample: values in channel order, or what gives them; robot time in seconds. It replaces the one
        before."""
        self._newest = (self._newest[0] + 1, t_s, values)

    @property
    def fresh(self) -> bool:
        """A sample waits that no frame has carried."""
        return self._newest[0] != self._seen_sample

    def force_key(self) -> None:
        """The next frame is a KEY and goes out even when nothing changed (if the source delivers)."""
        self._force += 1

    def tick(self, now_s: float) -> Due | None:
        """What is to be sent now: nothing without a new sample, nothing while the codes stand still, except
        that an unchanged robot is confirmed every CONFIRM_S. Time and sequence never count as a change."""
        number, t_s, values = self._newest
        force = self._force
        if number == self._seen_sample:
            return None
        codes = self._quantiser.codes(values() if callable(values) else values)
        force_key = force != self._seen_force
        if not force_key and codes == self._codes and now_s - self._sent_s < CONFIRM_S:
            return None
        self._seen_sample, self._seen_force = number, force
        self._codes, self._sent_s = codes, now_s
        return Due(codes, t_s, force_key)
