"""Calls that hang take no threads from others, and don't keep the process from exiting."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import threading
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from posecast_relay.auth import tokens
from posecast_relay.auth.tokens import Tokens, Unverifiable
from posecast_relay.core.policy import Audience, Principal
from posecast_relay.mirror.firebase import ServiceAccount
from posecast_relay.runtime.tasks import BlockingCalls, SharedTasks
from posecast_testing import until_async

HANGS = """
import asyncio, os, sys, time
from types import SimpleNamespace
from posecast_relay.archive.store import ArchiveAway, open_object_store
from posecast_relay.auth.tokens import Tokens

def hang(_):
    time.sleep(600)

async def main(what, folder):
    if what == "sign-in":
        asked = Tokens(SimpleNamespace(verify=hang)).identify("somebody")
    else:
        store = open_object_store(folder, 0.05)
        os.statvfs = hang  # as a network file system does
        asked = store.measure_free()
    try:
        await asyncio.wait_for(asked, 0.5)
    except (TimeoutError, ArchiveAway):
        print("nobody waits for it")

asyncio.run(main(*sys.argv[1:]))
"""


class Service:
    """A service whose calls hang until `answers` is set."""

    def __init__(self) -> None:
        self.answers = threading.Event()
        self.asked = self.running = 0
        self._lock = threading.Lock()

    def call(self, *_: Any) -> Any:
        """Wait for the answer. Fails if the test has forgotten to give it."""
        with self._lock:
            self.asked += 1
            self.running += 1
        assert self.answers.wait(30)
        with self._lock:
            self.running -= 1
        return SimpleNamespace(token="t", valid=True)


@contextmanager
def hanging() -> Iterator[Service]:
    """Yield a service that hangs, and let its calls end afterwards."""
    service = Service()
    try:
        yield service
    finally:
        service.answers.set()


def sign_in(service: Service, _patch: pytest.MonkeyPatch) -> Callable[[], Awaitable[Any]]:
    """A sign-in, whose service may hang."""

    def verify(token: str) -> Principal:
        service.call()
        return Principal(Audience.SIGNED_IN, token=token)

    signed = Tokens(SimpleNamespace(verify=verify))
    return lambda: signed.identify("somebody")


def fetch_account(service: Service, patch: pytest.MonkeyPatch) -> Callable[[], Awaitable[Any]]:
    """A service account's token, for the mirror, which waits for 5 s at most."""
    patch.setattr(ServiceAccount, "_fetch", service.call)
    account = ServiceAccount()

    async def fetch() -> str:
        async with asyncio.timeout(tokens.PATIENCE_S):
            return await account.get_token()

    return fetch


@pytest.mark.parametrize(("make", "at_once"), [(sign_in, tokens.AT_ONCE), (fetch_account, 1)])
async def test_a_service_that_hangs_takes_no_threads_from_others(
    make: Callable[[Service, pytest.MonkeyPatch], Callable[[], Awaitable[Any]]],
    at_once: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(tokens, "PATIENCE_S", 0.02)
    with hanging() as service:
        ask = make(service, monkeypatch)
        for _ in range(40):  # more rounds than asyncio has shared threads
            found = await asyncio.gather(*(ask() for _ in range(4)), return_exceptions=True)
            assert {type(each) for each in found} <= {Unverifiable, TimeoutError}
        await until_async("the calls have begun", lambda: service.asked >= at_once)
        assert service.asked == service.running == at_once
        assert await asyncio.wait_for(asyncio.to_thread(lambda: "free"), 10) == "free"
    monkeypatch.setattr(tokens, "PATIENCE_S", 20.0)
    assert await ask()  # the places are free again
    await until_async("all calls have ended", lambda: service.running == 0)


@pytest.mark.parametrize("what", ["sign-in", "folder"])
def test_what_hangs_does_not_keep_the_process_from_exiting(what: str, tmp_path: Path) -> None:
    command = [sys.executable, "-c", HANGS, what, tmp_path.as_uri()]
    ended = subprocess.run(command, timeout=60, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "nobody waits for it\n", "")


async def test_results_and_errors_are_those_of_the_call() -> None:
    calls = BlockingCalls(1, "test")
    assert await calls.run(divmod, 7, 2) == (3, 1)
    assert await calls.run(sorted, [1, 2], reverse=True) == [2, 1]
    for _ in range(3):  # an error frees the place
        with pytest.raises(ZeroDivisionError):
            await calls.run(divmod, 1, 0)


async def test_a_caller_that_stops_waiting_leaves_its_place_to_its_call() -> None:
    calls = BlockingCalls(1, "test")
    with hanging() as service:
        for _ in range(3):
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(calls.run(service.call), 0.02)
        await until_async("the call has begun", lambda: service.asked)
        assert service.asked == 1
        waiting = asyncio.create_task(calls.run(lambda: "next"))
        await asyncio.sleep(0)
        assert not waiting.done()
        service.answers.set()
        assert await asyncio.wait_for(waiting, 10) == "next"


async def test_a_thread_that_the_system_refuses_leaves_its_place_free(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls = BlockingCalls(1, "test")

    def refuse(_thread: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patch:
        patch.setattr(threading.Thread, "start", refuse)
        with pytest.raises(RuntimeError):
            await calls.run(int)
    assert await calls.run(int) == 0


# ---- what several ask for at the same time is done once ------------------------------


async def test_those_who_ask_meanwhile_wait_for_the_same_task() -> None:
    tasks, gate, calls = SharedTasks("test"), asyncio.Event(), 0

    async def work() -> int:
        nonlocal calls
        calls += 1
        await gate.wait()
        return calls

    first, second, other = (asyncio.create_task(tasks.run(key, work)) for key in ("a", "a", "b"))
    await asyncio.sleep(0)
    assert len(tasks.list_running()) == 2
    first.cancel()  # the others go on waiting
    await asyncio.sleep(0)
    gate.set()
    assert list(await asyncio.gather(second, other)) == [2, 2]
    assert tasks.list_running() == []
    assert await tasks.run("a", work) == 3


async def test_a_failure_is_told_to_all_and_done_anew() -> None:
    tasks = SharedTasks("test")

    async def fail() -> None:
        raise ValueError("no")

    found = await asyncio.gather(*(tasks.run("a", fail) for _ in range(2)), return_exceptions=True)
    assert [str(error) for error in found] == ["no", "no"]
    assert found[0] is found[1]
    with pytest.raises(ValueError, match="no") as again:
        await tasks.run("a", fail)
    assert again.value is not found[0]
