"""Measures how late a run's messages are, although the edge's clock and the relay's have different zeros.

Lateness is (arrival − stamp) minus the smallest such difference of the run. This is right while both clocks
run. A clock that stops (a sleeping laptop, a paused virtual machine) increases every later difference for
good, just as a congested uplink would. Only an answer to a question tells the two apart: it was stamped after
the question was sent, so it can't be later than the time since then.
"""

from __future__ import annotations

DRIFT = 1e-4  # two clocks drift apart by up to 100 ppm; ignoring that, lateness would grow all day
DOUBT_S = 0.5  # a message later than the one before by this much: is it late, or did its clock stop?
DOUBT_WAITS_S = (
    1.0,
    2.0,
    4.0,
    8.0,
    16.0,
    32.0,
)  # between questions about it; the last one repeats
DOUBT_ENDS_S = 60.0  # without a question; then the intervals start again


class Lateness:
    """Measures the lateness of one run's messages. `seconds` is the lateness of the newest one."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._least_s = float("inf")  # of arrival − stamp
        self._least_at = 0.0
        self._doubted = False
        self._questions = 0  # since the current doubt began
        self._question_at = float("-inf")  # earliest time for the next question

    def record_arrival(self, stamp_s: float, now: float) -> float:
        """Note a message's arrival and return its lateness in seconds.

        `stamp_s`: when it was made, by the edge's clock.
        """
        offset_s = now - stamp_s
        before_s = self.seconds
        self._raise_least(now)
        self._least_s = min(self._least_s, offset_s)
        self.seconds = offset_s - self._least_s
        self._doubted = self.seconds > DOUBT_S and (self._doubted or self.seconds - before_s > DOUBT_S)
        return self.seconds

    def record_answer(self, stamp_s: float, waited_s: float, now: float) -> None:
        """Note an answer that came `waited_s` seconds after its question. It can't be later than that."""
        self._raise_least(now)
        self._least_s = max(self._least_s, now - stamp_s - waited_s)
        self.record_arrival(stamp_s, now)

    def should_ask(self, now: float) -> bool:
        """Whether to send the edge a question now, to find out if its clock stopped.

        The intervals grow to save uplink bandwidth.
        """
        return self._doubted and now >= self._question_at

    def record_question(self, now: float) -> None:
        """Note that a question was sent. The next one waits longer."""
        if now - self._question_at > DOUBT_ENDS_S:
            self._questions = 0
        self._question_at = now + DOUBT_WAITS_S[min(self._questions, len(DOUBT_WAITS_S) - 1)]
        self._questions += 1

    def _raise_least(self, now: float) -> None:
        self._least_s += DRIFT * max(0.0, now - self._least_at)
        self._least_at = now
