"""How late one run's messages are, although its clock and the relay's share no zero.

Lateness is (arrival − stamp) above the smallest such difference of the run. That is right while both clocks
run. A clock that stood still (a laptop asleep, a paused virtual machine) makes every later difference larger
for good, exactly as a full uplink would; only an answer to a question tells the two apart: it was stamped
after the question was asked, so it is no later than the time since.
"""

from __future__ import annotations

DRIFT = 1e-4  # two clocks part by up to 100 ppm; without allowing for it, lateness would grow all day
DOUBT_S = 0.5  # a message so much later than the one before: is it late, or did its clock stand still?
DOUBT_WAITS_S = (
    1.0,
    2.0,
    4.0,
    8.0,
    16.0,
    32.0,
)  # between questions about it; then the last
DOUBT_ENDS_S = 60.0  # without a question: the next doubt begins with the first of these


class Lateness:
    """Measures the lateness of one run's messages. `seconds` is the lateness of the newest one."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._least_s = float("inf")  # of arrival − stamp
        self._least_at = 0.0
        self._doubted = False
        self._questions = 0  # since the doubt began
        self._question_at = float("-inf")  # not before

    def record_arrival(self, stamp_s: float, now: float) -> float:
        """Note a message's arrival and return its lateness in seconds.

        `stamp_s`: the edge's clock when it was made.
        """
        offset_s = now - stamp_s
        before_s = self.seconds
        self._raise_least(now)
        self._least_s = min(self._least_s, offset_s)
        self.seconds = offset_s - self._least_s
        self._doubted = self.seconds > DOUBT_S and (self._doubted or self.seconds - before_s > DOUBT_S)
        return self.seconds

    def record_answer(self, stamp_s: float, waited_s: float, now: float) -> None:
        """Note an answer that came `waited_s` seconds after its question: it is no later than that."""
        self._raise_least(now)
        self._least_s = max(self._least_s, now - stamp_s - waited_s)
        self.record_arrival(stamp_s, now)

    def should_ask(self, now: float) -> bool:
        """Whether to ask the edge now, to find out if its clock stood still.

        Intervals grow, to spare the uplink.
        """
        return self._doubted and now >= self._question_at

    def record_question(self, now: float) -> None:
        """Note that the edge was asked. The next question waits longer."""
        if now - self._question_at > DOUBT_ENDS_S:
            self._questions = 0
        self._question_at = now + DOUBT_WAITS_S[min(self._questions, len(DOUBT_WAITS_S) - 1)]
        self._questions += 1

    def _raise_least(self, now: float) -> None:
        self._least_s += DRIFT * max(0.0, now - self._least_at)
        self._least_at = now
