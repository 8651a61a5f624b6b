"""Names are looked up by one thread at a time, and nobody waits for it longer than they like."""

from __future__ import annotations

import asyncio
import socket
import threading
from typing import Any

import pytest
from posecast_relay.redis.client import HostLookup


async def test_a_name_that_is_there_and_names_that_are_not() -> None:
    await HostLookup("localhost").find()
    await HostLookup("127.0.0.1").find()
    for absent in ("no-such-host.invalid", "." * 5, "x" * 300):
        with pytest.raises(OSError, match=r"."):
            await HostLookup(absent).find()


async def test_a_resolver_that_does_not_answer_is_asked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    answers, asked = threading.Event(), []

    def slow(host: str, *_: Any, **__: Any) -> list[Any]:
        asked.append(host)
        assert answers.wait(30)
        return []

    monkeypatch.setattr(socket, "getaddrinfo", slow)
    lookup = HostLookup("redis")
    for _ in range(3):
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(lookup.find(), 0.02)
    assert asked == ["redis"]
    waiting = asyncio.create_task(lookup.find())
    answers.set()
    await asyncio.wait_for(waiting, 5)
    await asyncio.wait_for(lookup.find(), 5)
    assert asked == ["redis"] * 2
