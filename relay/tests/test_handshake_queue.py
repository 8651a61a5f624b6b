"""Handshakes spread over turns of the loop."""

from __future__ import annotations

import asyncio
from itertools import pairwise
from types import SimpleNamespace

import pytest
from posecast_relay.net.sse import TURN_S, HandshakeQueue


async def test_many_at_once_leave_room_for_others_and_keep_their_order(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    now, entered, between = 100.0, list[int](), list[int]()
    monkeypatch.setattr("posecast_relay.net.sse.time", SimpleNamespace(monotonic=lambda: now))
    doorway = HandshakeQueue()

    def enter(number: int) -> None:
        nonlocal now
        now += TURN_S / 4
        entered.append(number)
        if number == 5:
            raise ValueError("this one only")

    for number in range(20):
        doorway.admit(lambda number=number: enter(number))  # type: ignore[misc]
    assert entered == []
    while len(entered) < 20:
        await asyncio.sleep(0)
        between.append(len(entered))
    assert entered == list(range(20))
    assert max(b - a for a, b in pairwise([0, *between])) <= 5
    assert [record.getMessage() for record in caplog.records] == ["handshake failed"]
    doorway.admit(lambda: entered.append(20))
    while len(entered) < 21:
        await asyncio.sleep(0)
