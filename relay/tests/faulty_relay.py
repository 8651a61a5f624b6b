"""A relay in which one function at a time raises for whoever comes from VICTIM.

`python -m relay.tests.faulty_relay run …`, as the relay itself. A datagram to the port in FAULT_PORT says
which function it is; the answer is how often the one before has raised.
"""

from __future__ import annotations

import functools
import os
import socket
import threading
from collections.abc import Callable, Iterator
from inspect import iscoroutinefunction, isfunction
from typing import Any

from posecast_relay import cli
from posecast_relay.auth.access import Access
from posecast_relay.auth.addresses import Addresses
from posecast_relay.http.robots import StateReader
from posecast_relay.net.answer_cache import AnswerCache
from posecast_relay.net.encodings import EventStreamEncoding, JsonEncoding, JsonOutlet
from posecast_relay.net.http1 import HttpConnection, PendingRequests, RequestTimeouts
from posecast_relay.net.sse import EventStream, _Http
from posecast_relay.net.websocket import LiveSocket
from posecast_relay.runtime.tasks import isolated, isolated_task

VICTIM = "127.0.0.2"
ROBOT = "victim"
TOKEN = "L1.victim"
CLASSES = (
    *(LiveSocket, JsonOutlet, EventStream, HttpConnection, _Http),
    *(
        PendingRequests,
        RequestTimeouts,
        Addresses,
        Access,
        JsonEncoding,
        EventStreamEncoding,
        AnswerCache,
        StateReader,
    ),
)
# must not fail: what is called when something has failed, and what the process does for everybody at once
SOUND = {
    *("end_after_fault", "cut", "abort", "report_fault", "_work", "_sweep"),
    *("recheck_accounts", "recheck_once", "set_policy", "_readmit_some"),
}


class Fault(Exception):
    """Raised on purpose."""


class Faults:
    """Which function raises."""

    def __init__(self) -> None:
        self.name = ""
        self.raised = 0

    def raises(self, name: str, args: tuple[Any, ...]) -> bool:
        """Whether this call of it does."""
        if name != self.name or not any(of_victim(each) for each in args):
            return False
        self.raised += 1
        return True

    def listen(self, port: int) -> None:
        """For ever."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.bind(("127.0.0.1", port))
            while True:
                name, asker = sock.recvfrom(200)
                raised, self.name, self.raised = self.raised, name.decode(), 0
                sock.sendto(str(raised).encode(), asker)


def of_victim(value: Any) -> bool:
    """Whether an argument belongs to a connection from there, or to the robot of that name."""
    if isinstance(value, str):
        return value in (VICTIM, ROBOT, TOKEN) or value.startswith(f"{ROBOT}/")
    value = getattr(value, "_socket", value)
    transport = getattr(value, "_transport", None) or getattr(value, "transport", None) or value
    peer = getattr(transport, "get_extra_info", lambda _: None)("peername")
    if peer is not None:
        return bool(peer[0] == VICTIM)
    return getattr(value, "robot", None) == ROBOT or getattr(value, "name", None) == ROBOT


def functions() -> Iterator[tuple[type, str]]:
    """Every function of those classes that may fail."""
    for cls in CLASSES:
        for name, found in vars(cls).items():
            if isfunction(found) and name not in SOUND and not name.startswith("__"):
                yield cls, name


def spoil(faults: Faults, cls: type, name: str) -> None:
    """Let it raise where it is told to, inside its boundary if it has one. What cleans up does so first."""
    whole: Callable[..., Any] = vars(cls)[name]
    inner: Callable[..., Any] = getattr(whole, "__wrapped__", whole)
    known = f"{cls.__name__}.{name}"

    @functools.wraps(inner)
    def spoilt(*args: Any, **kwargs: Any) -> Any:
        if name == "connection_lost":
            inner(*args, **kwargs)
        if faults.raises(known, args):
            raise Fault(known)
        return None if name == "connection_lost" else inner(*args, **kwargs)

    @functools.wraps(inner)
    async def spoilt_task(*args: Any, **kwargs: Any) -> Any:
        if faults.raises(known, args):
            raise Fault(known)
        return await inner(*args, **kwargs)

    bounded = inner is not whole
    if iscoroutinefunction(inner):
        setattr(cls, name, isolated_task(spoilt_task) if bounded else spoilt_task)
    else:
        setattr(cls, name, isolated(spoilt) if bounded else spoilt)


if __name__ == "__main__":
    faults = Faults()
    for cls, name in functions():
        spoil(faults, cls, name)
    threading.Thread(target=faults.listen, args=(int(os.environ["FAULT_PORT"]),), daemon=True).start()
    cli.main()
