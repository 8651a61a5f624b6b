"""A span of the past becomes a folder of files: what is in it, what is not, and why."""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path

import pytest
from posecast_relay.past.segment import KeptSegment
from posecast_relay.recording import collector
from posecast_relay.recording.collector import NothingThere
from posecast_relay.recording.source import ListedSegment, PastDamaged
from posecast_wire.key_page import decode_key_page, encode_key_page
from posecast_wire.recording import (
    PastRecording,
    RecordingError,
    RecordingNote,
    decode_recording,
    key_page_path,
    model_path,
    segment_path,
    unpack_segment,
)
from posecast_wire.segment import Segment, decode_segment, encode_segment

from .past_doors import PAGE_MS, make_kept
from .recording_stage import KeptModel, KeptSource, collect, describe, list_files
from .taped_world import TapedWorld, on_air

GLB = {"high.glb": (b"glTF" * 100, "model/gltf-binary"), "parts/hand.png": (b"png", "image/png")}


def record(seconds: float, model: str | None = None) -> list[KeptSegment]:
    """What a recorder makes of some seconds with an event, a model and a silence."""
    world = TapedWorld()
    edge = on_air(world)
    if model is not None:
        world.hear_event(edge, type="model", hash=model)
    for n in range(round(seconds * 30)):
        world.pass_time(1 / 30)
        world.hear(edge, edge.frame(world.now, force_key=n % 60 == 0))
    world.hear_event(edge, source="RKN", text="jam", state="on")
    world.pass_time(3.0)
    return world.close()


def name_of(segment: KeptSegment) -> str:
    return segment_path(segment.name.take, segment.name.index)


def read(folder: Path) -> PastRecording:
    return decode_recording((folder / "recording.json").read_bytes())


def test_every_file_is_what_the_source_has_byte_for_byte(tmp_path: Path) -> None:
    model = KeptModel(GLB)
    kept = record(20.0, model.name)
    notes = [RecordingNote(kept[0].from_ms + 5, "Now.")]
    recording, found = collect(KeptSource(kept, [model]), tmp_path / "to", about=describe("Walking", notes))
    assert found.lost == []
    files = list_files(tmp_path / "to")
    assert files == sorted(
        [
            "recording.json",
            key_page_path(kept[0].from_ms),
            *map(name_of, kept),
            *(model_path(model.name, name) for name in ("manifest.json", *GLB)),
        ]
    )
    for each in kept:
        assert (tmp_path / "to" / name_of(each)).read_bytes() == each.data
    assert (tmp_path / "to" / model_path(model.name, "manifest.json")).read_bytes() == model.manifest
    for path, (data, _) in GLB.items():
        assert (tmp_path / "to" / model_path(model.name, path)).read_bytes() == data
    page = (tmp_path / "to" / key_page_path(kept[0].from_ms)).read_bytes()
    assert page == encode_key_page("r", "public", decode_key_page(page).from_ms, [each.data for each in kept])
    assert read(tmp_path / "to") == recording
    assert (recording.title, recording.author, recording.licence) == ("Walking", "A. Kim", "CC BY 4.0")
    assert recording.notes == tuple(notes)
    assert recording.models == (model.name,)
    assert {hashlib.sha256(text.encode()).hexdigest(): text for text in recording.schemas.values()} == dict(
        recording.schemas
    )
    assert sum((tmp_path / "to" / path).stat().st_size for path in files) == found.size


def test_the_index_says_what_segments_say(tmp_path: Path) -> None:
    kept = record(8.0)
    recording, _ = collect(KeptSource(kept), tmp_path / "to")
    assert (recording.from_ms, recording.to_ms) == (kept[0].from_ms, max(each.to_ms for each in kept))
    for each, said in zip(kept, recording.segments, strict=True):
        assert (said.take, said.index, said.run_id) == (each.name.take, each.name.index, each.run)
        assert (said.from_ms, said.to_ms, said.size) == (each.from_ms, each.to_ms, len(each.data))
        assert (said.frames, said.first_seq, said.last_seq) == (each.frames, each.first_seq, each.last_seq)
        assert (said.schema, said.model) == (each.schema.hex() if each.schema else None, each.model)
        assert said.missing == each.missing
        assert [(word.at_ms, word.word) for word in said.words] == [*each.words]
        assert [event.at_ms for event in said.events] == [event.at_ms for event in each.events]
    assert [event.event["text"] for said in recording.segments for event in said.events] == ["jam"]


def test_whole_segments_are_taken_as_far_as_they_reach_into_the_span(tmp_path: Path) -> None:
    kept = [make_kept(index, PAGE_MS + 4000 * index) for index in range(6)]  # 4 s each
    source = KeptSource(kept)

    def taken(name: str, from_ms: int, to_ms: int) -> list[int]:
        recording, _ = collect(source, tmp_path / name, PAGE_MS + from_ms, PAGE_MS + to_ms)
        return [each.index for each in recording.segments]

    assert taken("inside", 5000, 7000) == [1]
    assert taken("edges", 4000, 8000) == [1]
    assert taken("outwards", 3999, 8001) == [0, 1, 2]
    assert taken("one_ms", 4000, 4001) == [1]
    assert taken("all", -PAGE_MS, 1 << 40) == [0, 1, 2, 3, 4, 5]
    with pytest.raises(NothingThere):
        collect(source, tmp_path / "after", PAGE_MS + 24_000, PAGE_MS + 30_000)
    long = dataclasses.replace(kept[0], to_ms=PAGE_MS + 600_000)
    recording, found = collect(KeptSource([long, kept[1]]), tmp_path / "lie", PAGE_MS + 4000, PAGE_MS + 8000)
    assert [each.index for each in recording.segments] == [1]  # the other is not what its index says
    assert found.lost_count == 1


def test_overlapping_takes_stay_as_they_are(tmp_path: Path) -> None:
    kept = [make_kept(i, PAGE_MS + 2000 * i, take=10 + i % 2) for i in range(8)]
    recording, _ = collect(KeptSource(kept), tmp_path / "to")
    assert [(each.take, each.index) for each in recording.segments] == [(10 + i % 2, i) for i in range(8)]
    assert len(decode_key_page((tmp_path / "to" / key_page_path(PAGE_MS)).read_bytes()).poses) == 8


def test_pages_of_keys_are_of_ten_minutes_each_and_thinned_to_100_kb(tmp_path: Path) -> None:
    def large(index: int, from_ms: int) -> KeptSegment:
        kept = make_kept(index, from_ms)
        segment = decode_segment(kept.data)
        record = segment.frames[0]
        padded = record._replace(frame=record.frame + bytes(2000))
        data = encode_segment(Segment(segment.start, segment.to_ms, (padded,)))
        return dataclasses.replace(kept, data=data, events=())

    kept = [large(i, PAGE_MS + 4000 * i) for i in range(150)] + [make_kept(150, PAGE_MS + 600_000)]
    collect(KeptSource(kept), tmp_path / "to")
    assert sorted(path.name for path in (tmp_path / "to/keys").iterdir()) == [
        "2026-11-18T11-20Z.keys",
        "2026-11-18T11-30Z.keys",
    ]
    page = (tmp_path / "to/keys/2026-11-18T11-20Z.keys").read_bytes()
    assert len(page) <= 100_000
    assert [pose.index for pose in decode_key_page(page).poses] == [*range(0, 150, 4)]


def test_what_is_gone_damaged_or_swapped_is_left_out_and_named(tmp_path: Path) -> None:
    kept = [make_kept(index, PAGE_MS + 4000 * index) for index in range(6)]
    source = KeptSource(kept)
    take = kept[0].name.take
    del source.data[take, 1]
    source.data[take, 2] = kept[2].data[:-1]
    source.data[take, 3] = kept[4].data
    source.data[take, 4] = kept[4].data[:4] + b"\2" + kept[4].data[5:]
    recording, found = collect(source, tmp_path / "to")
    assert [each.index for each in recording.segments] == [0, 5]
    named = f"segments/{take:016x}"
    assert found.lost[0] == f"{named}/1.segment: gone before it could be read"
    assert found.lost[1].startswith(f"{named}/2.segment: byte ")
    assert found.lost[2] == f"{named}/3.segment: is of r/public, take {take:016x}, index 4"
    assert found.lost[3] == f"{named}/4.segment: byte 4: version 2, made by a newer Posecast"
    assert (found.lost_count, found.done, found.total) == (4, 6, 6)
    source.schemas.clear()
    with pytest.raises(NothingThere) as caught:
        collect(source, tmp_path / "nothing")
    assert "no segment of 6 could be read; the first: segments/" in str(caught.value)
    assert len(caught.value.args) == 1


def test_a_model_is_written_as_far_as_it_is_there(tmp_path: Path) -> None:
    model = KeptModel(
        {
            "low.glb": (b"low", "model/gltf-binary"),
            "gone.glb": (b"gone", "model/gltf-binary"),
            "low.glb/below.png": (b"x", ""),
            "manifest.json": (b"{}", "application/json"),
        }
    )
    del model.files["gone.glb"]
    unknown = "0d" * 32
    kept = [*record(4.0, model.name), make_kept(0, PAGE_MS, model=unknown, schema=None)]
    start = decode_segment(kept[-1].data).start
    data = encode_segment(Segment(dataclasses.replace(start, model=unknown, schema=None), kept[-1].to_ms, ()))
    kept[-1] = dataclasses.replace(kept[-1], data=data)
    recording, found = collect(KeptSource(kept, [model]), tmp_path / "to")
    assert set(recording.models) == {model.name, unknown}
    folder = tmp_path / "to/models" / model.name
    assert list_files(folder) == ["low.glb", "manifest.json"]
    assert (folder / "manifest.json").read_bytes() == model.manifest
    assert sorted(found.lost) == sorted(
        [
            f"models/{unknown}/manifest.json: no longer kept",
            f"models/{model.name}/gone.glb: no longer kept",
            f"models/{model.name}/low.glb/below.png: its path collides with another file's",
            f"models/{model.name}/manifest.json: its path collides with another file's",
        ]
    )


def test_nothing_but_what_a_model_is_made_of_comes_to_its_host(tmp_path: Path) -> None:
    page = b"<script>alert(1)</script>"
    strange = ["x.html", "x.HTM", "a/x.svg", ".htaccess", "noname", "x.html.glb", "x.php.png", "sw.js"]
    fine = ["High.GLB", "wheel.front.stl", "skins/v1.2.jpeg", "x.html/y.png"]
    model = KeptModel(dict.fromkeys((*strange, *fine), (page, "text/html")))
    _, found = collect(KeptSource(record(2.0, model.name), [model]), tmp_path / "to")
    folder = tmp_path / "to/models" / model.name
    assert list_files(folder) == sorted([*fine, "manifest.json"])
    assert found.lost == [f"models/{model.name}/x.html: not a file of a model and 7 more"]


class DamagedSource(KeptSource):
    """Whose answers for one model's file and one segment are of no use."""

    async def load_segment(self, segment: ListedSegment) -> bytes | None:
        """As a proxy that is not meant to be there."""
        if segment.index == 1:
            raise PastDamaged("not a segment: its Content-Type is text/html, not application/octet-stream")
        return await super().load_segment(segment)

    async def load_model_file(self, model: str, path: str, sha256: str, size: int) -> bytes | None:
        """As a relay whose answers are too long."""
        if path == "bad.glb":
            raise PastDamaged(f"http://relay/{path}: the answer is over {size} bytes")
        return await super().load_model_file(model, path, sha256, size)


def test_a_damaged_model_or_segment_is_told_in_a_line_and_the_rest_is_there(tmp_path: Path) -> None:
    kind = "model/gltf-binary"
    bad = KeptModel({"fine.glb": (b"fine", kind), "bad.glb": (b"bad", kind)})
    kept = record(20.0, bad.name)
    recording, found = collect(DamagedSource(kept, [bad]), tmp_path / "to")
    assert len(recording.segments) == len(kept) - 1
    assert found.lost == [
        f"{name_of(kept[1])}: not a segment: its Content-Type is text/html, not application/octet-stream",
        f"models/{bad.name}/: left out: http://relay/bad.glb: the answer is over 3 bytes",
    ]
    files = list_files(tmp_path / "to")
    assert not [path for path in files if path.startswith("models/")]
    assert sum((tmp_path / "to" / path).stat().st_size for path in files) == found.size


def test_what_no_recording_may_hold_is_refused(tmp_path: Path) -> None:
    kept = [make_kept(0, PAGE_MS)]
    note = RecordingNote(PAGE_MS + 5000, "after its end")
    with pytest.raises(RecordingError) as caught:
        collect(KeptSource(kept), tmp_path / "to", about=describe(notes=[note]))
    assert str(caught.value).startswith("notes[0].at_ms: must be a whole number from ")


def test_packed_segments_unpack_to_what_they_were(tmp_path: Path) -> None:
    kept = record(20.0)
    recording, _ = collect(KeptSource(kept), tmp_path / "to", packs=True)
    sizes = [(tmp_path / "to" / name_of(each)).stat().st_size for each in kept]
    assert sum(sizes) < 0.9 * sum(len(each.data) for each in kept)
    for each in kept:
        assert unpack_segment((tmp_path / "to" / name_of(each)).read_bytes()) == each.data
    assert [each.size for each in recording.segments] == [len(each.data) for each in kept]


@pytest.mark.parametrize(("hashes", "most"), [("schemas", 0), ("models", 1)])
def test_more_schemas_or_models_than_an_index_may_name_are_refused_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, hashes: str, most: int
) -> None:
    monkeypatch.setattr(collector, "HASHES_MAX", most)
    monkeypatch.setattr(collector, "_list_models", lambda _: ["5c" * 32, "ab" * 32])
    with pytest.raises(RecordingError, match=rf"^{hashes}: more than {most}: export a shorter span$"):
        collect(KeptSource(record(8.0)), tmp_path / "to")
    assert list_files(tmp_path / "to") == []
