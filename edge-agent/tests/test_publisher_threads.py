"""The publisher's threads inside this process: which of them uses the session while another closes it."""

from __future__ import annotations

import threading
import time

import pytest
import zenoh
from edge_stage import ROBOT, Router
from posecast_edge.uplink import publisher
from posecast_edge.uplink.publisher import ZenohPublisher
from posecast_testing import until

LOOK_S = 0.3  # so long a question goes on after the end


def test_a_session_is_closed_only_when_no_question_is_asked_over_it(
    router: Router, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(publisher, "ECHO_END_S", 20.0)
    asks, closed = threading.Event(), list[bool]()

    def ask_until_it_ends(self: ZenohPublisher, session: zenoh.Session) -> None:
        asks.set()
        until("the end", lambda: self._stopping, 20.0)
        until_s = time.monotonic() + LOOK_S
        while not session.is_closed() and time.monotonic() < until_s:
            time.sleep(0.01)
        closed.append(session.is_closed())

    monkeypatch.setattr(ZenohPublisher, "_echo_of", ask_until_it_ends)
    link = ZenohPublisher(ROBOT, ["public"], router.endpoint, snapshot=lambda _: None, heard=lambda _: None)
    link.start()
    until("it asks", asks.is_set)
    link.stop(20.0)
    link.wait_for_end(20.0)
    assert closed == [False]


def test_the_end_waits_for_the_threads_of_callbacks(router: Router, monkeypatch: pytest.MonkeyPatch) -> None:
    """A callback that returns from Zenoh into an interpreter that ends would abort the process."""
    is_called, may_return = threading.Event(), threading.Event()

    def hold(self: ZenohPublisher, session: zenoh.Session, event: zenoh.TransportEvent) -> None:
        del session
        self.connected = event.kind == zenoh.SampleKind.PUT
        if not self.connected:
            is_called.set()
            may_return.wait(20.0)

    monkeypatch.setattr(ZenohPublisher, "_on_transport", hold)
    link = ZenohPublisher(ROBOT, ["public"], router.endpoint, snapshot=lambda _: None, heard=lambda _: None)
    before = set(threading.enumerate())
    link.start()
    until("a link", lambda: link.connected)
    ours = set(threading.enumerate()) - before
    router.stop()
    until("the end of the link is told", is_called.is_set)
    link.stop(20.0)
    waiting = threading.Thread(target=link.wait_for_end, args=(20.0,))
    waiting.start()
    waiting.join(LOOK_S)
    assert waiting.is_alive()
    may_return.set()
    waiting.join(20.0)
    assert [t.name for t in ours if t.is_alive()] == []
