"""The small picture of a model: checked once, and given only where it can be served."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest
from posecast_relay.http.previews import LOADING_MAX, PICTURE_BYTES_MAX, Thumbnails
from posecast_relay.kit import REFUSED_S
from posecast_relay.models.cache import RETRY_S, Absent, ModelCache, Unavailable
from posecast_relay.models.memory import ENTRY_BYTES

from .pictures import make_png
from .test_model_cache import MB, Edge, sha256

SMALL = make_png(5, 3)


class Pictured(Edge):
    """A source of a model with a picture."""

    def __init__(self, picture: bytes, type_: str = "image/png", **more: Any) -> None:
        listed = [{"path": "p.png", "size": len(picture), "sha256": sha256(picture), "type": type_}]
        super().__init__({"p.png": picture}, {"v": 2, "files": listed, "thumbnail": "p.png", **more})


def make(edge: Edge) -> tuple[Thumbnails, ModelCache, SimpleNamespace]:
    clock = SimpleNamespace(now=0.0)
    models = ModelCache(edge, 10 * MB, lambda: clock.now)
    return Thumbnails(models, lambda: clock.now), models, clock


async def test_a_picture_that_is_one_is_found_with_its_size() -> None:
    edge = Pictured(SMALL)
    thumbnails, models, _ = make(edge)
    assert await thumbnails.find_size("r", edge.digest, 0.0) is None, "it has to come first"
    found = await thumbnails.load_picture("r", edge.digest)
    assert models.find_data(found.name) == SMALL
    assert await thumbnails.find_size("r", edge.digest, 0.0) == (5, 3)
    assert edge.asked_for(SMALL) == [0]


@pytest.mark.parametrize(
    ("picture", "type_", "why"),
    [
        (b"<script>alert(1)</script>", "image/png", "can't be shown: not a valid image/png"),
        (make_png(50_000, 50_000), "image/png", "can't be shown: 50000 × 50000 px; want 1 to 2048"),
        (SMALL, "image/jpeg", "can't be shown: not a valid image/jpeg"),
        (SMALL, "text/html", "no picture in this model"),
        (bytes(PICTURE_BYTES_MAX + 1), "image/png", "no picture in this model"),
    ],
    ids=["html", "huge", "another type", "no type of a picture", "too many bytes"],
)
async def test_what_is_no_small_picture_is_refused_in_a_line_and_fetched_once(
    picture: bytes, type_: str, why: str
) -> None:
    edge = Pictured(picture, type_)
    thumbnails, models, clock = make(edge)
    for _ in range(3):
        with pytest.raises(Absent, match=why):
            await thumbnails.load_picture("r", edge.digest)
        assert await thumbnails.find_size("r", edge.digest, 5.0) is None
        clock.now += 100 * REFUSED_S
        # what is kept has to go, and what was found out stays
        claim = models.room.claim("r", 10 * MB - ENTRY_BYTES, lambda: None)
        assert claim is not None
        models.room.release(claim)
        assert models.find_data(sha256(picture)) is None
    assert len(edge.asked_for(picture)) == ("can't be shown" in why)


async def test_nobody_waits_twice_for_a_robot_that_does_not_answer() -> None:
    edge = Pictured(SMALL)

    def away(_answer: bytes) -> bytes:
        raise Unavailable("the edge does not answer: timeout")

    edge.spoil = away
    thumbnails, _, clock = make(edge)
    for _ in range(3):
        assert await thumbnails.find_size("r", edge.digest, 5.0) is None
    assert edge.asked == [("manifest", 0)]
    edge.spoil = lambda answer: answer
    clock.now += max(REFUSED_S, RETRY_S)
    assert await thumbnails.find_size("r", edge.digest, 5.0) == (5, 3)


async def test_a_slow_one_comes_for_who_asks_later() -> None:
    edge, let = Pictured(SMALL), asyncio.Event()
    fetch = edge.fetch_manifest

    async def slow(_robot: str, _digest: str) -> bytes:
        await let.wait()
        return await fetch(_robot, _digest)

    edge.fetch_manifest = slow  # type: ignore[method-assign]
    thumbnails, _, clock = make(edge)
    first = asyncio.create_task(thumbnails.find_size("r", edge.digest, 5.0))
    await asyncio.sleep(0)
    clock.now += 5.0
    assert await thumbnails.find_size("r", edge.digest, 5.0) is None, "its time has passed"
    assert not first.done()
    let.set()
    assert await first == (5, 3)
    assert await thumbnails.find_size("r", edge.digest, 0.0) == (5, 3)


async def test_only_so_many_are_under_way() -> None:
    edge = Pictured(SMALL)
    never = asyncio.Event()

    async def stuck(_robot: str, _digest: str) -> bytes:
        await never.wait()
        raise AssertionError

    edge.fetch_manifest = stuck  # type: ignore[method-assign]
    thumbnails, _, _ = make(edge)
    before = len(asyncio.all_tasks())
    for n in range(2 * LOADING_MAX):
        assert await thumbnails.find_size(f"r{n}", edge.digest, 0.0) is None
    named = [task for task in asyncio.all_tasks() if task.get_name() == "picture"]
    assert len(named) == LOADING_MAX
    for task in named:
        task.cancel()
    await asyncio.gather(*named, return_exceptions=True)
    assert len(asyncio.all_tasks()) <= before + LOADING_MAX
