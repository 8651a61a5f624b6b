"""Robot time in a recording, which has two clocks: the timestamps in its messages, and the recorder's.

The timestamps are better: they say when something was measured. But some stand still, start again (a loop
that was recorded), or come from a simulation or another machine. Then the recorder's clock says how much time
has passed, and robot time goes on without a step. Pure.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from posecast_edge.kit import OnceLog, quote
from posecast_edge.sources.files.playback import MAX_PAUSE_S
from posecast_edge.sources.ros.merge import PUBLISHERS_MAX

STANDS_S = 0.5  # stamps that did not advance for this long are not used any more
BACK_S = 0.3  # a larger step back is a new beginning, a smaller one a late message
BEHIND_S = 1.0  # a publisher may be this late, for example because it filters
NEAR_S = 0.05  # stamps this near to robot time belong to the same clock
LINES_MAX = 8

Publisher = tuple[str, tuple[str, ...]]  # topic, labels


@dataclass(slots=True)
class _Stamps:
    """The stamps of one publisher. `newest_s`: the newest, which came at `log_s` of the recorder's clock;
    `shift_s`: robot time − stamp."""

    newest_s: float
    log_s: float
    shift_s: float = 0.0


class RecordedClock:
    """Gives each message its robot time. `say` is called with a line about stamps that can't be used as they
    are. `standing`: publishers whose stamps do not advance, as another clock found out."""

    def __init__(self, say: Callable[[str], None], standing: frozenset[Publisher] = frozenset()) -> None:
        self.standing = set(standing)
        self._once = OnceLog(say, LINES_MAX)
        self._publishers: dict[Publisher, _Stamps] = {}
        self._first: Publisher | None = None  # with whose message robot time began
        self._robot_s = self._log_s = 0.0  # the newest robot time, and the recorder's clock at that time

    def place(self, publisher: Publisher, stamp_s: float | None, log_s: float) -> float:
        """The robot time of a message. `log_s`: the recorder's clock, which does not step back."""
        if publisher in self.standing:
            self._report(publisher, "do not advance: the times of recording are used")
            stamp_s = None
        if self._first is not None:
            due_s = self._robot_s + max(0.0, log_s - self._log_s)
        else:
            self._first = publisher
            self._robot_s = due_s = log_s if stamp_s is None else stamp_s
        placed_s = due_s if stamp_s is None else self._shift(publisher, stamp_s, log_s, due_s)
        if placed_s >= self._robot_s:
            self._robot_s, self._log_s = placed_s, log_s
        return placed_s

    def _shift(self, publisher: Publisher, stamp_s: float, log_s: float, due_s: float) -> float:
        """The robot time of a stamp; `due_s`: what the recorder's clock expects."""
        off_s = stamp_s - due_s
        known = self._publishers.get(publisher)
        if known is None:
            if len(self._publishers) >= PUBLISHERS_MAX:
                self._publishers.clear()
            known = self._publishers[publisher] = _Stamps(stamp_s, log_s)
            if not -BEHIND_S <= off_s <= NEAR_S:
                known.shift_s = -off_s
            if abs(off_s) > BEHIND_S:
                how = "ahead of" if off_s > 0 else "behind"
                where = f"{abs(off_s):.1f} s {how} those of {_name(self._first or publisher)}"
                self._report(publisher, f"are {where}: the times of recording are used")
            return stamp_s + known.shift_s
        step_s = stamp_s - known.newest_s
        jumps = step_s < -BACK_S or step_s > log_s - known.log_s + MAX_PAUSE_S
        if jumps or (known.shift_s and off_s + known.shift_s > NEAR_S):
            known.shift_s = 0.0 if abs(off_s) <= NEAR_S else -off_s
        if jumps:
            how = "step back" if step_s < 0 else "jump ahead"
            self._report(publisher, f"{how} by {abs(step_s):.1f} s: robot time goes on without the step")
        if jumps or step_s > 0:
            known.newest_s, known.log_s = stamp_s, log_s
        elif log_s - known.log_s >= STANDS_S:
            self.standing.add(publisher)
            return self.place(publisher, None, log_s)
        return stamp_s + known.shift_s

    def _report(self, publisher: Publisher, what: str) -> None:
        self._once.add(
            f"the timestamps of {_name(publisher)} {what}", " ".join((publisher[0], *publisher[1]))
        )


def _name(publisher: Publisher) -> str:
    topic, labels = publisher
    return f"{topic} ({quote(labels[0])}{', …' if len({*labels}) > 1 else ''})" if labels else topic
