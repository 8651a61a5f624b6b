"""`posecast-edge`, broken on purpose: the fault suite must notice it.

broken_edge.py sticks|late run …

The product contains none of this; it is patched here, in a separate process.
"""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable

from posecast_edge.cli.main import main
from posecast_edge.pipeline.stream import NEVER, Due, Offered, Sampler
from posecast_wire.quantiser import Quantiser

WELL = 60  # it breaks after this many frames
LATE_SAMPLES = 5 * 30


def codes_that_stick() -> None:
    """The robot moves, but its frames say that it does not."""
    tick, codes = Sampler.tick, Quantiser.quantise
    sent: list[Due] = []

    def count(self: Sampler, now_s: float, oldest_s: float = NEVER) -> Due | None:
        due = tick(self, now_s, oldest_s)
        if due is not None:
            sent.append(due)
        return due

    def stick(self: Quantiser, values: list[float | None]) -> list[int]:
        return codes(self, values) if len(sent) < WELL else sent[-1].codes

    Sampler.tick = count  # type: ignore[method-assign]
    Quantiser.quantise = stick  # type: ignore[method-assign, assignment]


def old_samples_as_fresh() -> None:
    """Each sample waits for a hundred and fifty others, and is then sent as if it had just been taken."""
    offer = Sampler.offer
    waiting: deque[tuple[float, Offered]] = deque()

    def offer_later(self: Sampler, t_s: float, values: Offered, taken_s: float) -> None:
        waiting.append((t_s, values))
        if len(waiting) > LATE_SAMPLES:
            offer(self, *waiting.popleft(), taken_s)

    Sampler.offer = offer_later  # type: ignore[method-assign]


WAYS: dict[str, Callable[[], None]] = {"sticks": codes_that_stick, "late": old_samples_as_fresh}

if __name__ == "__main__":
    WAYS[sys.argv.pop(1)]()
    main()
