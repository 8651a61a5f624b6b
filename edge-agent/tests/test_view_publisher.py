"""When a view's frames may go, beside a real Zenoh router."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import zenoh
from edge_stage import ROBOT, Router, until
from posecast_edge.exception_log import ExceptionLog
from posecast_edge.uplink.run import Run
from posecast_edge.uplink.session_config import make_zenoh_config
from posecast_edge.uplink.view_publisher import ViewPublisher
from posecast_wire.keys import frame_key

T = TypeVar("T")


class LateCallbacks(ExceptionLog):
    """Keeps what Zenoh's threads call until it is let through, as a busy machine does."""

    def __init__(self) -> None:
        super().__init__()
        self.late = False
        self.waiting: list[Callable[[], None]] = []

    def guard(self, place: str, call: Callable[[T], None]) -> Callable[[T], None]:
        def take(argument: T) -> None:
            if self.late:
                self.waiting.append(lambda: call(argument))
            else:
                call(argument)

        return take


def test_whoever_makes_keys_knows_of_the_relay_before_a_frame_may_go() -> None:
    router, callbacks, heard = Router(), LateCallbacks(), list[str]()
    router.start(subscribe=False)
    session = zenoh.open(make_zenoh_config(router.endpoint))
    try:
        view = ViewPublisher(ROBOT, "public", Run(), lambda: None, lambda: heard.append("a relay"), callbacks)
        held = view.declare(session)
        assert (view.has_listener, heard, len(held)) == (False, [], 2)
        callbacks.late = True
        assert router.session is not None
        subscriber = router.session.declare_subscriber(frame_key(ROBOT, "public"), print)
        until(lambda: view.has_listener, "a listener")
        assert heard == ["a relay"]
        until(lambda: len(callbacks.waiting) == 1, "Zenoh's callback")
        callbacks.waiting[0]()
        assert (view.has_listener, heard) == (True, ["a relay"])  # one KEY, not two
        subscriber.undeclare()  # type: ignore[no-untyped-call]
    finally:
        session.close()  # type: ignore[no-untyped-call]
        router.stop()
