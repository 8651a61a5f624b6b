"""Models as a relay keeps them: verified, asked for once, bounded in memory. The edge is played here."""

from __future__ import annotations

import asyncio
import hashlib
import json
from collections.abc import Callable
from typing import Any

import pytest
from posecast_relay.adapters.models import (
    FILES_MAX,
    MANIFEST_BYTES_MAX,
    MANIFESTS_MAX,
    RANGE_BYTES,
    TRIES,
    Absent,
    Models,
    Unavailable,
)

MB = 1_000_000


def sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


class Edge:
    """A source of one model: files by path. `spoil` may change an answer, or fail."""

    def __init__(self, files: dict[str, bytes], document: Any = None) -> None:
        listed = [
            {"path": p, "size": len(d), "sha256": sha256(d), "type": "model/stl"} for p, d in files.items()
        ]
        self.bytes = json.dumps({"v": 2, "files": listed} if document is None else document).encode()
        self.digest = sha256(self.bytes)
        self.asked: list[tuple[str, int]] = []
        self.spoil: Callable[[bytes], bytes] = lambda data: data
        self._by_hash = {sha256(d): d for d in files.values()}

    def offers(self, _robot: str, digest: str) -> bool:
        return digest == self.digest

    async def manifest(self, _robot: str, _digest: str) -> bytes:
        self.asked.append(("manifest", 0))
        await asyncio.sleep(0)
        return self.spoil(self.bytes)

    async def read(self, _robot: str, _digest: str, wanted: str, off: int, size: int) -> bytes:
        assert 0 < size <= RANGE_BYTES
        self.asked.append((wanted, off))
        await asyncio.sleep(0)
        return self.spoil(self._by_hash[wanted][off : off + size])

    def asked_for(self, data: bytes) -> list[int]:
        return [off for wanted, off in self.asked if wanted == sha256(data)]


def bytes_of(seed: int, size: int) -> bytes:
    return hashlib.shake_128(bytes([seed])).digest(size)


async def test_a_file_comes_in_ranges_once_for_all_who_ask() -> None:
    data = bytes_of(1, 2 * RANGE_BYTES + 1)
    edge = Edge({"a.stl": data})
    models = Models(edge, 10 * MB)
    found = await asyncio.gather(*(models.file("r", edge.digest, "a.stl") for _ in range(5)))
    assert {f.data for f in found} == {data}
    assert edge.asked_for(data) == [0, RANGE_BYTES, 2 * RANGE_BYTES]
    assert edge.asked.count(("manifest", 0)) == 1
    assert (await models.file("r", edge.digest, "a.stl")).data == data
    assert len(edge.asked) == 4


async def test_one_who_goes_away_does_not_stop_the_others() -> None:
    data = bytes_of(1, 1000)
    edge = Edge({"a.stl": data})
    models = Models(edge, 10 * MB)
    first = asyncio.create_task(models.file("r", edge.digest, "a.stl"))
    second = asyncio.create_task(models.file("r", edge.digest, "a.stl"))
    await asyncio.sleep(0)
    first.cancel()
    assert (await second).data == data


async def test_the_oldest_goes_when_memory_is_full() -> None:
    files = {f"{i}.stl": bytes_of(i, 400_000) for i in range(5)}
    edge = Edge(files)
    models = Models(edge, MB)  # room for two
    for path in ("0.stl", "1.stl", "0.stl", "2.stl"):  # 1 is then the one asked for longest ago
        assert (await models.file("r", edge.digest, path)).data == files[path]
    for path in ("0.stl", "2.stl"):
        await models.file("r", edge.digest, path)
    assert [len(edge.asked_for(files[f"{i}.stl"])) for i in range(3)] == [2, 2, 2]
    await models.file("r", edge.digest, "1.stl")
    assert len(edge.asked_for(files["1.stl"])) == 4


async def test_a_file_larger_than_all_room_is_not_begun() -> None:
    data = bytes_of(1, MB)
    edge = Edge({"a.stl": data})
    with pytest.raises(Unavailable, match="more than this relay keeps"):
        await Models(edge, MB - 1).file("r", edge.digest, "a.stl")
    assert edge.asked_for(data) == []


async def test_manifests_are_bounded() -> None:
    class Many(Edge):
        def offers(self, _robot: str, _digest: str) -> bool:
            return True

    edge = Many({})
    models = Models(edge, MB)
    for i in range(MANIFESTS_MAX + 1):
        await models.manifest(f"r{i}", edge.digest)
    await models.manifest(f"r{MANIFESTS_MAX}", edge.digest)
    assert len(edge.asked) == MANIFESTS_MAX + 1
    await models.manifest("r0", edge.digest)
    assert len(edge.asked) == MANIFESTS_MAX + 2


async def test_a_hiccup_costs_a_range_and_not_the_file() -> None:
    data = bytes_of(1, 3 * RANGE_BYTES)
    edge = Edge({"a.stl": data})
    left = TRIES - 1

    def hiccup(answer: bytes) -> bytes:
        nonlocal left
        if len(edge.asked) > 2 and left:
            left -= 1
            raise Unavailable("the edge does not answer: timeout")
        return answer

    edge.spoil = hiccup
    assert (await Models(edge, MB).file("r", edge.digest, "a.stl")).data == data
    assert edge.asked_for(data) == [0, *[RANGE_BYTES] * TRIES, 2 * RANGE_BYTES]


async def test_an_edge_that_stays_away_is_asked_a_few_times() -> None:
    data = bytes_of(1, RANGE_BYTES)
    edge = Edge({"a.stl": data})
    models = Models(edge, MB)
    await models.manifest("r", edge.digest)

    def away(_answer: bytes) -> bytes:
        raise Unavailable("the edge does not answer: timeout")

    edge.spoil = away
    for n in (1, 2):
        with pytest.raises(Unavailable, match="does not answer"):
            await models.file("r", edge.digest, "a.stl")
        assert len(edge.asked_for(data)) == n * TRIES


@pytest.mark.parametrize(
    "spoil",
    [lambda d: d[:-1] + b"x", lambda _: b"", lambda _: bytes(RANGE_BYTES + 1)],
    ids=["other", "none", "more"],
)
async def test_what_is_not_what_its_name_says_is_never_kept(spoil: Callable[[bytes], bytes]) -> None:
    data = bytes_of(1, 1000)
    edge = Edge({"a.stl": data})
    models = Models(edge, MB)
    await models.manifest("r", edge.digest)
    edge.spoil = spoil
    with pytest.raises(Unavailable):
        await models.file("r", edge.digest, "a.stl")
    edge.spoil = lambda answer: answer
    assert (await models.file("r", edge.digest, "a.stl")).data == data


@pytest.mark.parametrize("digest", ["", "x", "../../etc/passwd", "A" * 64, "0" * 64])
async def test_what_nobody_offers_is_absent(digest: str) -> None:
    edge = Edge({"a.stl": b"1"})
    models = Models(edge, MB)
    with pytest.raises(Absent):
        await models.manifest("r", digest)
    with pytest.raises(Absent, match="no file"):
        await models.file("r", edge.digest, "b.stl")
    assert len(edge.asked) == 1


GOOD = {"path": "a", "size": 1, "sha256": "0" * 64}


@pytest.mark.parametrize(
    "document",
    [
        [],
        {"v": 2},
        {"files": {}},
        {"files": ["a.stl"]},
        {"files": [{"path": "a"}]},
        {"files": [GOOD | {"size": -1}]},
        {"files": [GOOD | {"size": "much"}]},
        {"files": [GOOD | {"sha256": "../x"}]},
        {"files": [GOOD | {"path": str(i)} for i in range(FILES_MAX + 1)]},
        {"files": [], "filler": "x" * MANIFEST_BYTES_MAX},
    ],
    ids=lambda document: str(document)[:40],
)
async def test_a_manifest_that_is_none(document: Any) -> None:
    edge = Edge({}, document)
    with pytest.raises(Unavailable) as refused:
        await Models(edge, MB).manifest("r", edge.digest)
    assert "manifest" in str(refused.value)


async def test_a_type_that_could_act_is_not_told() -> None:
    data = b"<script>"
    entry = {"path": "a.html", "size": len(data), "sha256": sha256(data), "type": "text/html"}
    edge = Edge({"a.html": data}, {"files": [entry]})
    found = await Models(edge, MB).file("r", edge.digest, "a.html")
    assert found.type == "application/octet-stream"
