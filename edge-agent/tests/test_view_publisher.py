"""When a view's frames may go, and that none of its events is lost with the link: beside a real Zenoh
router."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import pytest
import zenoh
from edge_stage import ROBOT, Router
from posecast_edge.kit import ExceptionLog
from posecast_edge.pipeline.events import Event
from posecast_edge.uplink.publisher import EVENTS_MAX, ViewPublisher, ZenohPublisher
from posecast_edge.uplink.route import RelayRoute
from posecast_edge.uplink.session import Run, make_zenoh_config
from posecast_testing import until
from posecast_wire.keys import frame_key

T = TypeVar("T")
VIEWS = ("public", "lab")


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
        until("a listener", lambda: view.has_listener)
        assert heard == ["a relay"]
        until("Zenoh's callback", lambda: len(callbacks.waiting) == 1)
        callbacks.waiting[0]()
        assert (view.has_listener, heard) == (True, ["a relay"])  # one KEY, not two
        subscriber.undeclare()  # type: ignore[no-untyped-call]
    finally:
        session.close()  # type: ignore[no-untyped-call]
        router.stop()


# ---- what waits for the link


class Breaking:
    """A view's publisher of events. `breaks` is called before each put; what it raises, put raises."""

    def __init__(self, link: ZenohPublisher, view: str, breaks: Callable[[], None]) -> None:
        self._breaks = breaks
        self._view = link._view_publishers[view]
        self._real = self._view._events
        self._view._events = self  # type: ignore[assignment]

    @property
    def matching_status(self) -> Any:
        return self._real.matching_status  # type: ignore[union-attr]

    def put(self, data: bytes, **more: Any) -> None:
        self._breaks()
        self._real.put(data, **more)  # type: ignore[union-attr]


@pytest.fixture
def link(router: Router) -> Iterator[ZenohPublisher]:
    made = ZenohPublisher(
        ROBOT, VIEWS, RelayRoute(router.endpoint), snapshot=lambda _: None, heard=lambda _: None
    )
    made.start()
    until("a link", lambda: made.connected and made.may_send)
    yield made
    made.stop(20.0)
    made.wait_for_end(20.0)


def queue(link: ZenohPublisher, texts: list[str], view: str = "public") -> None:
    for text in texts:
        link.queue_event(view, Event(0.0, "fault", "test", text, True))


def texts_of(router: Router) -> list[object]:
    return [event["text"] for event in list(router.events) if event["type"] == "event"]


def fail_each(times: int) -> Callable[[], None]:
    """Raise for so many calls, then once more for every other one, six times."""
    calls = 0

    def fail() -> None:
        nonlocal calls
        calls += 1
        if calls <= times or (calls < times + 12 and calls % 2):
            raise zenoh.ZError("the link breaks")

    return fail


@pytest.mark.parametrize("times", [1, 3])
def test_events_whose_put_failed_arrive_once_and_in_order(
    router: Router, link: ZenohPublisher, times: int
) -> None:
    Breaking(link, "public", fail_each(times))
    texts = [f"fault {n}" for n in range(8)]
    queue(link, texts[:4])
    queue(link, texts[4:])
    until("all events", lambda: len(texts_of(router)) >= 8)
    queue(link, ["last"])
    until("the last event", lambda: "last" in texts_of(router))
    assert texts_of(router) == [*texts, "last"]


def test_events_that_meet_the_end_of_a_session_go_on_the_next(router: Router, link: ZenohPublisher) -> None:
    session = link._session
    assert session is not None
    Breaking(link, "public", session.close)  # Zenoh's own error, at each put until there is a new session
    texts = [f"fault {n}" for n in range(5)]
    queue(link, texts)
    until("all events", lambda: len(texts_of(router)) >= 5)
    assert texts_of(router) == texts
    assert link._session is not session


def test_info_and_model_whose_put_failed_are_sent_as_they_are_then(
    router: Router, link: ZenohPublisher
) -> None:
    failed = threading.Event()
    may_go = threading.Event()

    def fail() -> None:
        failed.set()
        if not may_go.is_set():
            raise zenoh.ZError("the link breaks")

    Breaking(link, "public", fail)
    with link._wake:
        link._view_publishers["public"].model = "0" * 64
    until("an attempt", failed.is_set)
    link.queue_info("public", {"mode": "walking"})
    link.queue_info("public", {"mode": "sitting"})
    may_go.set()
    until("info and model", lambda: len(router.events) >= 2)
    assert [each for each in router.events if each["type"] == "model"] == [
        {"type": "model", "hash": "0" * 64}
    ]
    assert {"type": "info", "kv": {"mode": "sitting"}} in router.events


def test_info_that_changes_while_it_is_being_sent_is_sent_as_it_is_then(
    router: Router, link: ZenohPublisher
) -> None:
    hangs, may_go = threading.Event(), threading.Event()

    def hang() -> None:
        if not hangs.is_set():
            hangs.set()
            assert may_go.wait(20.0)

    Breaking(link, "public", hang)
    link.queue_info("public", {"mode": "walking"})
    until("a put that hangs", hangs.is_set)
    link.queue_info("public", {"mode": "fallen"})
    may_go.set()
    until("both", lambda: len(router.events) >= 2)
    assert [event["kv"] for event in router.events] == [{"mode": "walking"}, {"mode": "fallen"}]


def test_a_view_that_fails_keeps_no_other_from_sending(router: Router, link: ZenohPublisher) -> None:
    def fail() -> None:
        raise zenoh.ZError("for good")

    Breaking(link, "public", fail)
    queue(link, ["never"])
    queue(link, [f"{n}" for n in range(5)], "lab")
    until("the other view's events", lambda: len(texts_of(router)) >= 5)
    assert texts_of(router) == [f"{n}" for n in range(5)]
    link.stop(20.0)  # which does not wait for it
    assert not link._thread.is_alive()


def test_an_event_that_no_link_could_send_is_left_out_alone(router: Router, link: ZenohPublisher) -> None:
    queue(link, ["before", "half a \ud800 pair", "after"])
    until("the others", lambda: len(texts_of(router)) >= 2)
    assert texts_of(router) == ["before", "after"]
    assert link.exceptions.count("sending events of public") == 1


def test_what_waits_while_a_put_hangs_is_bounded_and_none_is_sent_twice(
    router: Router, link: ZenohPublisher
) -> None:
    hangs, may_go, calls = threading.Event(), threading.Event(), list[int]()

    def hang() -> None:
        calls.append(1)
        if len(calls) == 1:
            hangs.set()
            assert may_go.wait(20.0)

    Breaking(link, "public", hang)
    texts = [f"fault {n}" for n in range(3 * EVENTS_MAX)]
    queue(link, texts[:1])
    until("a put that hangs", hangs.is_set)
    queue(link, texts[1:])
    may_go.set()
    until("the newest", lambda: texts[-1] in texts_of(router))
    assert texts_of(router) == [texts[0], *texts[-EVENTS_MAX:]]
