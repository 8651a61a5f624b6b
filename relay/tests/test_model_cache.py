"""Models as a relay keeps them: verified, asked for once, bounded in memory. The edge is played here."""

from __future__ import annotations

import asyncio
import gc
import hashlib
import json
import tracemalloc
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from posecast_relay.kit import REFUSED_S
from posecast_relay.models.cache import AT_ONCE, RANGE_BYTES, TRIES, Absent, ModelCache, Unavailable
from posecast_relay.models.manifest import BYTES_MAX, FILES_MAX

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

    async def fetch_manifest(self, _robot: str, _digest: str) -> bytes:
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


async def read(models: ModelCache, edge: Edge, path: str, robot: str = "r") -> bytes:
    """A file's bytes, as an answer takes them."""
    name, _, size = await models.load_file(robot, edge.digest, path)
    data = models.copy_piece(name, 0, size)
    assert data is not None
    return data


def bytes_of(seed: int, size: int) -> bytes:
    return hashlib.shake_128(bytes([seed])).digest(size)


async def test_a_file_comes_in_ranges_once_for_all_who_ask() -> None:
    data = bytes_of(1, 2 * RANGE_BYTES + 1)
    edge = Edge({"a.stl": data})
    models = ModelCache(edge, 10 * MB)
    found = await asyncio.gather(*(read(models, edge, "a.stl") for _ in range(5)))
    assert set(found) == {data}
    assert edge.asked_for(data) == [0, RANGE_BYTES, 2 * RANGE_BYTES]
    assert edge.asked.count(("manifest", 0)) == 1
    assert await read(models, edge, "a.stl") == data
    assert len(edge.asked) == 4


async def test_one_who_goes_away_does_not_stop_the_others() -> None:
    data = bytes_of(1, 1000)
    edge = Edge({"a.stl": data})
    models = ModelCache(edge, 10 * MB)
    first = asyncio.create_task(read(models, edge, "a.stl"))
    second = asyncio.create_task(read(models, edge, "a.stl"))
    await asyncio.sleep(0)
    first.cancel()
    assert await second == data


async def test_the_oldest_goes_when_memory_is_full() -> None:
    files = {f"{i}.stl": bytes_of(i, 400_000) for i in range(5)}
    edge = Edge(files)
    models = ModelCache(edge, MB)  # room for two
    for path in ("0.stl", "1.stl", "0.stl", "2.stl"):  # 1 is then the one asked for longest ago
        assert await read(models, edge, path) == files[path]
    for path in ("0.stl", "2.stl"):
        await models.load_file("r", edge.digest, path)
    assert [len(edge.asked_for(files[f"{i}.stl"])) for i in range(3)] == [2, 2, 2]
    await models.load_file("r", edge.digest, "1.stl")
    assert len(edge.asked_for(files["1.stl"])) == 4


async def test_a_file_larger_than_all_room_is_not_begun() -> None:
    data = bytes_of(1, MB)
    edge = Edge({"a.stl": data})
    with pytest.raises(Unavailable, match="more than this relay keeps"):
        await ModelCache(edge, MB - 1).load_file("r", edge.digest, "a.stl")
    assert edge.asked_for(data) == []


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
    assert await read(ModelCache(edge, MB), edge, "a.stl") == data
    assert edge.asked_for(data) == [0, *[RANGE_BYTES] * TRIES, 2 * RANGE_BYTES]


async def test_an_edge_that_stays_away_is_asked_a_few_times() -> None:
    data = bytes_of(1, RANGE_BYTES)
    edge = Edge({"a.stl": data})
    models = ModelCache(edge, MB)
    await models.load_manifest("r", edge.digest)

    def away(_answer: bytes) -> bytes:
        raise Unavailable("the edge does not answer: timeout")

    edge.spoil = away
    for n in (1, 2):
        with pytest.raises(Unavailable, match="does not answer"):
            await models.load_file("r", edge.digest, "a.stl")
        assert len(edge.asked_for(data)) == n * TRIES


@pytest.mark.parametrize(
    "spoil",
    [lambda d: d[:-1] + b"x", lambda _: b"", lambda _: bytes(RANGE_BYTES + 1)],
    ids=["other", "none", "more"],
)
async def test_what_is_not_what_its_name_says_is_never_kept(spoil: Callable[[bytes], bytes]) -> None:
    data, clock = bytes_of(1, 1000), SimpleNamespace(now=0.0)
    edge = Edge({"a.stl": data})
    models = ModelCache(edge, MB, lambda: clock.now)
    await models.load_manifest("r", edge.digest)
    edge.spoil = spoil
    with pytest.raises(Unavailable):
        await models.load_file("r", edge.digest, "a.stl")
    edge.spoil = lambda answer: answer
    clock.now += REFUSED_S
    assert await read(models, edge, "a.stl") == data


@pytest.mark.parametrize("digest", ["", "x", "../../etc/passwd", "A" * 64, "0" * 64])
async def test_what_nobody_offers_is_absent(digest: str) -> None:
    edge = Edge({"a.stl": b"1"})
    models = ModelCache(edge, MB)
    with pytest.raises(Absent):
        await models.load_manifest("r", digest)
    with pytest.raises(Absent, match="no file"):
        await models.load_file("r", edge.digest, "b.stl")
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
        {"files": [], "filler": "x" * BYTES_MAX},
    ],
    ids=lambda document: str(document)[:40],
)
async def test_a_manifest_that_is_none(document: Any) -> None:
    edge = Edge({}, document)
    with pytest.raises(Unavailable) as refused:
        await ModelCache(edge, MB).load_manifest("r", edge.digest)
    assert "manifest" in str(refused.value)


async def test_a_type_that_could_act_is_not_told() -> None:
    data = b"<script>"
    entry = {"path": "a.html", "size": len(data), "sha256": sha256(data), "type": "text/html"}
    edge = Edge({"a.html": data}, {"files": [entry]})
    found = await ModelCache(edge, MB).load_file("r", edge.digest, "a.html")
    assert found.type == "application/octet-stream"


async def turns(count: int = 50) -> None:
    """Let what was begun go on."""
    for _ in range(count):
        await asyncio.sleep(0)


class Liar(Edge):
    """Declares large files, and answers each range with as many bytes of its own."""

    def __init__(self, count: int, size: int) -> None:
        files = [
            {"path": f"{n}.glb", "size": size, "sha256": sha256(b"%d" % n), "type": "model/gltf-binary"}
            for n in range(count)
        ]
        super().__init__({}, {"files": files})
        self.answers = asyncio.Event()
        self.answers.set()

    async def read(self, _robot: str, _digest: str, wanted: str, off: int, size: int) -> bytes:
        self.asked.append((wanted, off))
        await self.answers.wait()
        await asyncio.sleep(0)
        return bytes(size)


async def test_declared_files_never_take_more_than_the_room_and_nothing_once_their_askers_have_left() -> None:
    edge = Liar(40, 8 * MB)
    models = ModelCache(edge, 10 * MB)
    await models.load_manifest("r", edge.digest)
    tracemalloc.start()
    try:
        asking = [asyncio.create_task(models.load_file("r", edge.digest, f"{n}.glb")) for n in range(40)]
        most = 0
        while len(edge.asked) < 150:
            await asyncio.sleep(0)
            most = max(most, models.room.used)
        for each in asking:
            each.cancel()
        await asyncio.gather(*asking, return_exceptions=True)
        asked = len(edge.asked)
        await turns()
        asking.clear()
        gc.collect()
        kept, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(edge.asked) == asked, "nobody waits for it any more"
    assert most <= models.room.most
    assert peak < 12 * MB
    assert kept < MB
    assert models.room.used < 100_000  # the manifest


async def test_a_size_that_is_only_claimed_takes_no_memory() -> None:
    edge = Liar(1, 90 * MB)
    edge.answers.clear()
    models = ModelCache(edge, 100 * MB)
    tracemalloc.start()
    try:
        asking = asyncio.create_task(models.load_file("r", edge.digest, "0.glb"))
        while len(edge.asked) < 2:
            await asyncio.sleep(0)
        assert tracemalloc.get_traced_memory()[1] < MB
    finally:
        tracemalloc.stop()
    asking.cancel()
    await turns()


async def test_the_last_of_several_askers_ends_the_work_and_a_new_one_begins_it_anew() -> None:
    edge = Liar(1, 4 * RANGE_BYTES)
    edge.answers.clear()
    models = ModelCache(edge, 10 * MB)
    first, second = (asyncio.create_task(models.load_file("r", edge.digest, "0.glb")) for _ in range(2))
    await turns()
    assert edge.asked == [("manifest", 0), (sha256(b"0"), 0)]
    first.cancel()
    await turns()
    assert not second.done()
    assert models.room.used > 4 * RANGE_BYTES
    second.cancel()
    await turns()
    assert models.room.used < 4 * RANGE_BYTES
    third = asyncio.create_task(models.load_file("r", edge.digest, "0.glb"))
    await turns()
    assert edge.asked.count((sha256(b"0"), 0)) == 2
    third.cancel()
    await turns()


class Several:
    """Robots with a model each, by name."""

    def __init__(self, **edges: Edge) -> None:
        self.edges = edges

    def offers(self, robot: str, digest: str) -> bool:
        return self.edges[robot].offers(robot, digest)

    async def fetch_manifest(self, robot: str, digest: str) -> bytes:
        return await self.edges[robot].fetch_manifest(robot, digest)

    async def read(self, robot: str, digest: str, wanted: str, off: int, size: int) -> bytes:
        return await self.edges[robot].read(robot, digest, wanted, off, size)


async def test_a_robot_whose_edge_does_not_answer_keeps_no_other_waiting() -> None:
    stuck, good = Liar(40, 3 * MB), Edge({"a.stl": bytes_of(1, 4 * MB)})
    stuck.answers.clear()
    models = ModelCache(Several(stuck=stuck, good=good), 10 * MB)
    askers = [asyncio.create_task(models.load_file("stuck", stuck.digest, f"{n}.glb")) for n in range(40)]
    await turns()
    assert len(stuck.asked) == 1 + 3, "its manifest, and as many files as there is room for"
    assert await read(models, good, "a.stl", "good") == bytes_of(1, 4 * MB)
    gave_way = [each for each in askers if each.done()]
    assert [type(each.exception()) for each in gave_way] == [Unavailable] * len(gave_way)
    assert gave_way
    for each in askers:
        each.cancel()
    await turns()


async def test_what_waits_for_room_gets_it_when_there_is_some(monkeypatch: pytest.MonkeyPatch) -> None:
    stuck, good = Liar(1, 6 * MB), Edge({"b": bytes_of(2, 6 * MB)})
    stuck.answers.clear()
    models = ModelCache(Several(stuck=stuck, good=good), 10 * MB)
    for each, robot in ((stuck, "stuck"), (good, "good")):
        await models.load_manifest(robot, each.digest)
    first = asyncio.create_task(models.load_file("stuck", stuck.digest, "0.glb"))
    await turns()
    with monkeypatch.context() as patched:  # the other has as much, and is just being asked for
        patched.setattr("posecast_relay.models.cache.WAIT_S", 0.0)
        with pytest.raises(Unavailable, match="no memory"):
            await models.load_file("good", good.digest, "b")
    second = asyncio.create_task(read(models, good, "b", "good"))
    await turns()
    assert good.asked_for(bytes_of(2, 6 * MB)) == []
    first.cancel()
    assert await second == bytes_of(2, 6 * MB)


async def test_a_robot_has_a_few_files_under_way_at_once() -> None:
    edge = Liar(40, 1000)
    edge.answers.clear()
    models = ModelCache(edge, 10 * MB)
    askers = [asyncio.create_task(models.load_file("r", edge.digest, f"{n}.glb")) for n in range(40)]
    await turns()
    assert len(edge.asked) == 1 + AT_ONCE
    for each in askers:
        each.cancel()
    await turns()


async def test_the_same_bytes_of_two_robots_are_kept_and_counted_once() -> None:
    data = bytes_of(1, MB)
    one, two = Edge({"a.stl": data}), Edge({"b.stl": data})
    models = ModelCache(Several(one=one, two=two), 10 * MB)
    await asyncio.gather(read(models, one, "a.stl", "one"), read(models, two, "b.stl", "two"))
    assert MB < models.room.used < 1.1 * MB


async def test_who_knows_the_hash_of_anothers_file_does_not_have_it() -> None:
    """A robot that not everybody may see has been asked for it. Another one's manifest names it, no more."""
    data = bytes_of(1, 2000)
    hidden, thief, clock = Edge({"a.stl": data}), Edge({"a.stl": data}), SimpleNamespace(now=0.0)
    thief.spoil = lambda answer: answer if answer == thief.bytes else b""
    models = ModelCache(Several(hidden=hidden, thief=thief), 10 * MB, lambda: clock.now)
    assert await read(models, hidden, "a.stl", "hidden") == data
    with pytest.raises(Unavailable, match="0 bytes at 0 of 2000"):
        await models.load_file("thief", thief.digest, "a.stl")
    thief.spoil = lambda answer: answer
    clock.now += REFUSED_S
    assert await read(models, thief, "a.stl", "thief") == data
    asked = len(thief.asked)
    assert await read(models, thief, "a.stl", "thief") == data
    assert len(thief.asked) == asked, "once delivered is enough"


@pytest.mark.parametrize("size", [1, 1999, 2001, 300_000_000])
async def test_a_manifest_that_gives_a_file_another_size_is_not_believed(size: int) -> None:
    """Also where the file is here already: the robot's earlier model told the truth."""
    data = bytes_of(1, 2000)
    edge = Edge({"a.stl": data})
    source = Several(r=edge)
    models = ModelCache(source, 10 * MB)
    assert await read(models, edge, "a.stl") == data
    false = {"path": "b.stl", "size": size, "sha256": sha256(data), "type": "model/stl"}
    source.edges["r"] = later = Edge({"b.stl": data}, {"v": 2, "files": [false]})
    with pytest.raises(Unavailable, match="not have the size"):
        await models.load_file("r", later.digest, "b.stl")


async def test_a_short_range_is_no_range() -> None:
    edge = Edge({"a.stl": bytes_of(1, 2000)})
    models = ModelCache(edge, MB)
    await models.load_manifest("r", edge.digest)
    edge.spoil = lambda data: data[:1]
    with pytest.raises(Unavailable, match="1 bytes at 0 of 2000"):
        await models.load_file("r", edge.digest, "a.stl")
    assert len(edge.asked) == 2


async def test_a_path_from_outside_is_shown_as_what_it_is() -> None:
    edge = Edge({"a.stl": b"1"})
    with pytest.raises(Absent) as refused:
        await ModelCache(edge, MB).load_file("r", edge.digest, "\u202e" + "x" * 10_000)
    assert str(refused.value).isprintable()
    assert len(str(refused.value)) < 200
