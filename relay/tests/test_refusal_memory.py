"""What was refused does not cross a robot's uplink again for some seconds, however many ask for it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

import httpx
import pytest
from posecast_relay.kit import REFUSED_MAX, REFUSED_S, RefusalMemory
from posecast_relay.models.cache import RANGE_BYTES, ModelCache, Refused, Unavailable
from posecast_testing import until

from .stage import Model, Relay
from .test_http_models import is_announced
from .test_model_cache import MB, Edge, Several, bytes_of, read

ASKERS = 50


def make_cache(source: Any) -> tuple[ModelCache, SimpleNamespace]:
    clock = SimpleNamespace(now=0.0)
    return ModelCache(source, 10 * MB, lambda: clock.now), clock


async def count_refusals(load: Callable[[], Any]) -> int:
    """How many of ASKERS at once, and of as many one after the other, are refused."""
    at_once = await asyncio.gather(*(load() for _ in range(ASKERS)), return_exceptions=True)
    refused = sum(isinstance(each, Refused) for each in at_once)
    for _ in range(ASKERS):
        with pytest.raises(Refused):
            await load()
        refused += 1
    return refused


async def test_a_file_that_is_another_is_fetched_once_in_a_while() -> None:
    data = bytes_of(1, 2 * RANGE_BYTES)
    edge = Edge({"a.stl": data})
    models, clock = make_cache(edge)
    await models.load_manifest("r", edge.digest)
    edge.spoil = lambda answer: bytes(len(answer))
    assert await count_refusals(lambda: models.load_file("r", edge.digest, "a.stl")) == 2 * ASKERS
    assert edge.asked_for(data) == [0, RANGE_BYTES]
    edge.spoil = lambda answer: answer
    clock.now += REFUSED_S - 1
    with pytest.raises(Refused, match="does not match its manifest") as refused:
        await models.load_file("r", edge.digest, "a.stl")
    assert refused.value.retry_s == 1
    clock.now += 1
    assert await read(models, edge, "a.stl") == data


@pytest.mark.parametrize("document", [None, {"v": 2}], ids=["another digest", "no manifest"])
async def test_a_manifest_that_is_refused_likewise(document: Any) -> None:
    edge = Edge({"a.stl": b"1"}, document)
    if document is None:
        edge.spoil = lambda answer: answer + b" "
    models, clock = make_cache(edge)
    assert await count_refusals(lambda: models.load_file("r", edge.digest, "a.stl")) == 2 * ASKERS
    assert edge.asked == [("manifest", 0)]
    clock.now += REFUSED_S
    with pytest.raises(Refused):
        await models.load_manifest("r", edge.digest)
    assert len(edge.asked) == 2


async def test_what_one_robot_got_wrong_counts_for_no_other_and_for_no_other_model_of_its_own() -> None:
    one, two = Edge({"a.stl": b"right"}), Edge({"a.stl": b"right"})
    models, _ = make_cache(Several(one=one, two=two))
    one.spoil = lambda answer: answer if answer == one.bytes else b"wrong"
    with pytest.raises(Refused):
        await models.load_file("one", one.digest, "a.stl")
    assert await read(models, two, "a.stl", "two") == b"right"
    mended = Edge({"b.stl": b"mended"})
    models, _ = make_cache(source := Several(one=one))
    with pytest.raises(Refused):
        await models.load_file("one", one.digest, "a.stl")
    source.edges["one"] = mended
    assert await read(models, mended, "b.stl", "one") == b"mended"


async def test_an_edge_that_does_not_answer_is_asked_again() -> None:
    edge = Edge({"a.stl": b"1"})
    models, _ = make_cache(edge)

    def away(_answer: bytes) -> bytes:
        raise Unavailable("the edge does not answer: timeout")

    edge.spoil = away
    with pytest.raises(Unavailable):
        await models.load_manifest("r", edge.digest)
    edge.spoil = lambda answer: answer
    assert await read(models, edge, "a.stl") == b"1"


def test_it_holds_so_many_and_forgets_the_oldest_first() -> None:
    memory = RefusalMemory(lambda: 0.0)
    for n in range(2 * REFUSED_MAX):
        memory.keep(n, "bad")
    assert memory._kept.cost == REFUSED_MAX
    assert memory.find(REFUSED_MAX - 1) is None
    assert memory.find(REFUSED_MAX) == ("bad", REFUSED_S)


class Forger(Model):
    """Answers for its file with other bytes, as many as it should have."""

    def __init__(self, size: int) -> None:
        super().__init__({"a.glb": (bytes_of(1, size), "model/gltf-binary")})
        self.sent = 0

    def answer(self, key: str, parameters: dict[str, str]) -> bytes | None:
        """As an edge that was broken into."""
        if key.endswith("manifest"):
            return super().answer(key, parameters)
        self.sent += int(parameters["len"])
        return bytes(int(parameters["len"]))


def test_over_a_real_uplink_fifty_requests_cost_one_file(relay: Relay, edges: Any) -> None:
    model = Forger(MB)
    edges(relay, model=model)
    until("it is announced", partial(is_announced, relay))
    with httpx.Client() as client:
        answers = [client.get(f"{relay.api}/model/{model.digest}/a.glb") for _ in range(ASKERS)]
    assert {answer.status_code for answer in answers} == {503}
    assert {answer.json()["error"] for answer in answers} == {"the file does not match its manifest"}
    assert all(1 <= int(answer.headers["retry-after"]) <= REFUSED_S for answer in answers)
    assert model.sent == MB
