"""Derives the state of the link (on air, refused, late) and the frame rate from the relay's echoes. Does no
I/O."""

from __future__ import annotations

from collections import deque

from posecast_wire.keys import Echo

LATE_S = 0.5  # above it, the rate is halved; a slower answer holds frames back
CALM_S = 0.25  # below it for RECOVER_S, the rate doubles again
RECOVER_S = 5.0
SETTLE_S = 2.0  # time to wait before judging whether frames are accepted, or whether the lower rate helped
LOWEST_HZ = 1.0
OVER_S = 5.0  # without a reported excess for this long, the relay accepts everything again
SENT_MAX = 2048  # frames remembered: half a minute at 60 Hz; older ones are forgotten


class EchoWatch:
    """Compares the frames sent in one run with the relay's echoes. Times are monotonic seconds."""

    def __init__(self, run_id: int) -> None:
        self._run_id = run_id
        self._sent: deque[tuple[int, float]] = deque(maxlen=SENT_MAX)
        self._first: tuple[int, float] | None = None  # seq and time of the first frame since the link came up
        self._newest: int | None = None  # seq of the newest
        self._quickest_s: float | None = None
        self._connected = False
        self._echo: Echo | None = None
        self._asked_s: float | None = None  # when the pending query was sent
        self.late_s = 0.0

    def record_link(self, connected: bool) -> None:
        """Record that the link came up or went down, and forget the relay's state."""
        self._connected = connected
        self._echo = None
        self._asked_s = None
        self._first = self._newest = None
        self._sent.clear()
        self.late_s = 0.0

    def record_frame(self, seq: int, now_s: float) -> None:
        """Record that frame `seq` was sent at `now_s` (monotonic seconds)."""
        if self._first is None:
            self._first = (seq, now_s)
        self._newest = seq
        self._sent.append((seq, now_s))

    def record_question(self, now_s: float) -> None:
        """Record that an echo was requested at `now_s` (monotonic seconds)."""
        self._asked_s = now_s

    def is_queue_full(self, now_s: float) -> bool:
        """Whether to hold frames back: the relay answered before but is slow now, so queries and frames wait
        in a queue on the way. True until the pending query is answered or times out."""
        if self._asked_s is None or self._echo is None or self._quickest_s is None:
            return False
        return now_s - self._asked_s > LATE_S + self._quickest_s

    def record_answer(self, echo: Echo | None, asked_s: float, now_s: float) -> None:
        """Evaluate the echo that was requested at `asked_s`; None when none arrived in time."""
        self._echo = echo
        self._asked_s = None
        round_trip_s = now_s - asked_s
        if echo is None and round_trip_s < LATE_S:
            self.late_s = 0.0  # no relay answered: that is not lateness
            return
        if echo is not None:
            quickest_s = self._quickest_s
            self._quickest_s = round_trip_s if quickest_s is None else min(quickest_s, round_trip_s)
        # Query and frames wait in the same queue, so a slow answer means late frames. A frame that was sent
        # well before the query and has not arrived is late itself.
        self.late_s = round_trip_s - (self._quickest_s or 0.0)
        if echo is not None and self._accepted(echo):
            while self._sent and self._sent[0][0] <= echo.seq:
                self._sent.popleft()
            if self._sent:
                self.late_s = max(self.late_s, asked_s - self._sent[0][1])

    def _accepted(self, echo: Echo) -> bool:
        """Whether the relay has accepted a frame that this run sent since the link came up. A number that was
        never sent does not count."""
        if echo.run_id != self._run_id or self._first is None or self._newest is None:
            return False
        return self._first[0] <= echo.seq <= self._newest

    @property
    def over(self) -> str:
        """The relay's limit that the robot exceeds, from the newest echo; "" for none."""
        return "" if self._echo is None else self._echo.over

    def describe_state(self, now_s: float) -> str:
        """The state of the link: "no link", "no relay", "refused", "on air", "late" or "waiting"."""
        if not self._connected:
            return "no link"
        if self._echo is None:
            return "late" if self.late_s > LATE_S else "no relay"
        if not self._accepted(self._echo):
            waited = self._first is not None and now_s - self._first[1] > SETTLE_S
            return "refused" if waited else "waiting"
        return "late" if self.late_s > LATE_S else "on air"


class News:
    """Selects the changes of the link's state that are worth a log line; reports each change once."""

    def __init__(self) -> None:
        self._refused = False
        self._over = ""
        self._over_s = 0.0  # when a limit was last exceeded

    def list_changes(self, word: str, over: str, now_s: float) -> list[str]:
        """Log lines for the changes since the last call. `word` and `over` come from EchoWatch at `now_s`
        (monotonic seconds)."""
        lines: list[str] = []
        if word == "refused" and not self._refused:
            self._refused = True
            lines.append("the relay accepts no frames: does another agent publish this robot? Still sending")
        elif word in ("on air", "late") and self._refused:
            self._refused = False
            lines.append("on air again")
        if over:
            self._over_s = now_s
            if over != self._over:
                lines.append(f"the relay drops some of this robot's data: more than {over}")
            self._over = over
        elif self._over and word in ("on air", "late") and now_s - self._over_s > OVER_S:
            self._over = ""
            lines.append("the relay accepts all of this robot's data again")
        return lines


class RateControl:
    """Halves the frame rate while frames arrive late, and doubles it again when they arrive in time."""

    def __init__(self, hz: float) -> None:
        self._full_hz = hz
        self.hz = hz
        self._changed_s = float("-inf")
        self._calm_since_s: float | None = None

    def record_lateness(self, late_s: float, now_s: float) -> None:
        """Adjust the rate to a new measurement of lateness (seconds) at monotonic `now_s`."""
        if late_s >= CALM_S:
            self._calm_since_s = None
        elif self._calm_since_s is None:
            self._calm_since_s = now_s
        if now_s - self._changed_s < SETTLE_S:
            return
        if late_s > LATE_S and self.hz > LOWEST_HZ:
            self.hz, self._changed_s = max(LOWEST_HZ, self.hz / 2), now_s
        elif (
            self._calm_since_s is not None
            and now_s - self._calm_since_s >= RECOVER_S
            and self.hz < self._full_hz
        ):
            self.hz, self._changed_s, self._calm_since_s = min(self._full_hz, self.hz * 2), now_s, now_s
