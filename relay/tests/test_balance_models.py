"""What models say of balance: read once, kept with the models, and never waited for long."""

from __future__ import annotations

import asyncio
import json
from types import SimpleNamespace
from typing import Any

import pytest
from posecast_relay.balance.model import BalanceModel, read_balance_model
from posecast_relay.http.balance_models import AWAY, LOADING_MAX, BalanceModels, NoBalance
from posecast_relay.models.cache import ModelCache, Unavailable
from posecast_relay.models.refusal_memory import REFUSED_S

from .balance_stage import make_manifest
from .test_model_cache import MB, Edge


def make(document: Any, room: int = 10 * MB) -> tuple[BalanceModels, Edge, ModelCache, SimpleNamespace]:
    """Of a robot whose manifest this is."""
    clock = SimpleNamespace(now=0.0)
    edge = Edge({}, document)
    models = ModelCache(edge, room, lambda: clock.now)
    return BalanceModels(models, lambda: clock.now), edge, models, clock


async def test_a_model_is_fetched_and_read_once_for_all_who_ask(monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[int] = []

    def counted(data: bytes) -> BalanceModel:
        read.append(len(data))
        return read_balance_model(data)

    monkeypatch.setattr("posecast_relay.http.balance_models.read_balance_model", counted)
    balances, edge, models, _ = make(make_manifest())
    found = await asyncio.gather(*(balances.find_model("r", edge.digest, 60.0) for _ in range(5)))
    again = await balances.find_model("r", edge.digest, 60.0)
    assert isinstance(again, BalanceModel)
    assert {id(each) for each in found} == {id(again)}
    assert len(read) == 1
    assert edge.asked == [("manifest", 0)]
    assert models.room.used > len(edge.bytes), "it is counted"


async def test_what_is_no_model_is_remembered_and_told_in_a_line() -> None:
    balances, edge, _, _ = make(make_manifest(joints=[]))
    for _ in range(2):
        found = await balances.find_model("r", edge.digest, 60.0)
        assert found == NoBalance("bad-model", "joints: 4 links need 3")
    no_json, edge, _, _ = make("text")
    assert await no_json.find_model("r", edge.digest, 60.0) == AWAY, "the relay refuses it itself"


async def test_nobody_waits_long_for_a_robot_that_does_not_answer() -> None:
    balances, edge, _, clock = make(make_manifest())
    goes_on = asyncio.Event()

    async def slowly(_robot: str, _digest: str) -> bytes:
        edge.asked.append(("manifest", 0))
        await goes_on.wait()
        return edge.bytes

    edge.fetch_manifest = slowly  # type: ignore[method-assign]
    assert await balances.find_model("r", edge.digest, 0.0) == AWAY
    clock.now += 1.0
    assert await balances.find_model("r", edge.digest, 1.0) == AWAY, "it has waited from the first asker on"
    assert len(edge.asked) == 1
    goes_on.set()
    clock.now -= 1.0
    assert isinstance(await balances.find_model("r", edge.digest, 60.0), BalanceModel)


async def test_a_robot_that_refuses_is_not_asked_again_at_once() -> None:
    balances, edge, _, clock = make(make_manifest())

    def away(_answer: bytes) -> bytes:
        raise Unavailable("the edge does not answer: timeout")

    edge.spoil = away
    for _ in range(3):
        assert await balances.find_model("r", edge.digest, 60.0) == AWAY
    assert len(edge.asked) == 1
    clock.now += REFUSED_S + 1
    await balances.find_model("r", edge.digest, 60.0)
    assert len(edge.asked) == 2


async def test_another_robots_hash_is_no_model() -> None:
    balances, edge, _, _ = make(make_manifest())
    assert await balances.find_model("r", "0" * 64, 60.0) == AWAY
    assert edge.asked == []


async def test_without_room_there_is_none_and_nothing_else_goes() -> None:
    manifest = make_manifest()
    size = len(json.dumps(manifest))
    balances, edge, models, _ = make(manifest, 2 * (5 * size + 2 * 4096))
    models.room.claim("other", models.room.most // 2 - 4096, lambda: None)
    found = await balances.find_model("r", edge.digest, 60.0)
    assert found == AWAY or isinstance(found, BalanceModel)
    assert models.room.used <= models.room.most


async def test_only_so_many_are_under_way() -> None:
    balances, edge, _, _ = make(make_manifest())
    stays = asyncio.Event()

    async def never(_robot: str, _digest: str) -> bytes:
        await stays.wait()
        return edge.bytes

    edge.fetch_manifest = never  # type: ignore[method-assign]
    for i in range(LOADING_MAX):
        assert await balances.find_model(f"r{i}", edge.digest, 0.0) == AWAY
    waiting = asyncio.create_task(balances.find_model("one-more", edge.digest, 60.0))
    assert await waiting == AWAY
    stays.set()
