"""`posecast-relay`, broken on purpose: what the fault suite must notice.

broken_relay.py backpressure|fifo|runs run …

The product knows none of this; it is patched here, in a process of its own.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable

from posecast_relay.cli import main
from posecast_relay.core.actions import Action
from posecast_relay.core.room import Group, Room
from posecast_relay.core.runs import Runs
from posecast_relay.core.stream import Held
from posecast_relay.core.viewer import Viewer


def without_backpressure() -> None:
    """Writes on, whatever the socket and the acknowledgements say."""
    Viewer.paused = lambda _self, _now: None  # type: ignore[method-assign, assignment]
    Viewer.may_send = lambda _self, _now: True  # type: ignore[method-assign, assignment]


def fifo_instead_of_mailbox() -> None:
    """Who can't take a frame now gets it later, and all those after it, in order."""
    mailbox = Room._pass

    def queue(
        self: Room, group: Group, viewers: Iterable[Viewer], frame: Held, now: float, out: list[Action]
    ) -> None:
        viewers = tuple(viewers)
        for viewer in viewers:
            waits = viewer.blocked or (now >= viewer.check_at and not viewer.may_send(now))
            if waits and viewer.frame is not frame:
                viewer.lane = [*(viewer.lane or ()), self._lacking(viewer, frame)]
                self._hand(viewer, frame)
        mailbox(self, group, viewers, frame, now, out)

    Room._pass = queue  # type: ignore[method-assign]


def unchecked_runs() -> None:
    """No run is ever retired: whoever sends a KEY is believed."""
    Runs.is_retired = lambda _self, _run_id, _now: False  # type: ignore[method-assign, assignment]


WAYS: dict[str, Callable[[], None]] = {
    "backpressure": without_backpressure,
    "fifo": fifo_instead_of_mailbox,
    "runs": unchecked_runs,
}

if __name__ == "__main__":
    WAYS[sys.argv.pop(1)]()
    main()
