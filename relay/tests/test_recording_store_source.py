"""The past of an object store: what one audience could see of it live, nothing deleted, nothing foreign."""

from __future__ import annotations

import asyncio
import hashlib
import os
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path

import pytest
from posecast_relay.archive.deletion import put_tombstone
from posecast_relay.archive.models import make_model_key
from posecast_relay.archive.names import make_schema_key, name_segment
from posecast_relay.archive.store import ObjectStore, open_object_store
from posecast_relay.core.policy import Audience
from posecast_relay.past.deletions import Deletion
from posecast_relay.past.segment import KeptSegment
from posecast_relay.past_command.main import run_past
from posecast_relay.recording.store_source import StoreSource
from posecast_wire.recording import PastRecording, decode_recording, segment_path

from .past_doors import PAGE_MS, SCHEMA, SCHEMA_HASH, make_kept
from .recording_stage import KeptModel, list_files, make_page
from .test_recording_collector import record

DAY_MS = 86_400_000


async def fill(store: ObjectStore, segments: Sequence[KeptSegment]) -> None:
    """As a relay writes it."""
    for each in segments:
        await store.put(name_segment(each).key, each.data)
        if each.schema is not None:
            assert each.schema_text is not None
            await store.put(make_schema_key(each.name.robot, each.schema), each.schema_text.encode())


def export(folder: Path, *arguments: str, out: str = "x.posecast") -> PastRecording:
    """What the command makes of a store of all."""
    command = [
        "export",
        "--robot",
        "r",
        "--from",
        "2026-01-01",
        "--to",
        "2099-01-01",
        "-o",
        str(folder / out),
    ]
    run_past([*command, *arguments], {"POSECAST_PAST": f"file://{folder}/store"})
    if out != "x.posecast":
        return decode_recording((folder / out / "recording.json").read_bytes())
    with zipfile.ZipFile(folder / out) as packed:
        recording = decode_recording(packed.read("recording.json"))
        assert packed.testzip() is None
    (folder / out).unlink()
    return recording


def list_lost(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """The lines about what could not be read, before the one about the span, which is of decades."""
    *lost, span = capsys.readouterr().err.splitlines()
    assert ": there is nothing before 20" in span
    return lost


@pytest.fixture
def store(tmp_path: Path) -> ObjectStore:
    """A store in a folder."""
    return open_object_store(f"file://{tmp_path}/store")


def test_a_folder_of_a_stores_past(tmp_path: Path, store: ObjectStore) -> None:
    model = KeptModel({"high.glb": (os.urandom(1000), "model/gltf-binary")})
    kept = record(20.0, model.name)

    async def keep() -> None:
        await fill(store, kept)
        await store.put(make_model_key("r", model.name, "manifest.json"), model.manifest)
        await store.put(make_model_key("r", model.name, "high.glb"), model.files["high.glb"])

    asyncio.run(keep())
    page = make_page(tmp_path / "page")
    recording = export(tmp_path, "--page", str(page), "--to", "2099-01-01", out="lecture")
    assert (recording.robot, recording.view, recording.models) == ("r", "public", (model.name,))
    for each in kept:
        file = tmp_path / "lecture" / segment_path(each.name.take, each.name.index)
        assert file.read_bytes() == each.data
    assert (tmp_path / "lecture/models" / model.name / "high.glb").read_bytes() == model.files["high.glb"]


def test_only_what_the_audience_could_see_live(tmp_path: Path, store: ObjectStore) -> None:
    letters = [
        frozenset(Audience),
        frozenset((Audience.LINK,)),
        frozenset((Audience.SIGNED_IN, Audience.LINK)),
        frozenset[Audience](),
        frozenset((Audience.ANYONE,)),
    ]
    kept = [make_kept(i, PAGE_MS + 4000 * i, audiences=of) for i, of in enumerate(letters)]
    asyncio.run(fill(store, kept))

    def shown(*arguments: str) -> list[int]:
        return [each.index for each in export(tmp_path, *arguments).segments]

    assert shown() == [0, 4]
    assert shown("--as", "anyone") == [0, 4]
    assert shown("--as", "link") == [0, 1, 2]
    assert shown("--as", "signed-in") == [0, 2]


def test_what_is_deleted_or_foreign_is_not_there(
    tmp_path: Path, store: ObjectStore, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = [make_kept(i, PAGE_MS + 4000 * i) for i in range(10)]
    later = [make_kept(20 + i, PAGE_MS + 3 * DAY_MS + 600_000 * i) for i in range(3)]

    async def keep() -> None:
        await fill(store, [*kept, *later])
        await put_tombstone(
            store, Deletion("r", None, PAGE_MS + 8000, PAGE_MS + 16_000, PAGE_MS + 99_000, "a" * 16)
        )
        await put_tombstone(store, Deletion("other", None, 0, 1 << 50, PAGE_MS, "b" * 16))
        page = name_segment(kept[0]).key.rpartition("/")[0]
        await store.put(f"{page}/notes.txt", b"foreign")
        await store.put(name_segment(kept[0]).key.replace("-a", "-x"), b"foreign")
        await store.put("r/public/2026-11-18/99-99/x.segment", b"foreign")
        await store.put("tombstones/r/1-zz.json", b"foreign")
        await store.put(name_segment(make_kept(30, PAGE_MS + 60_000)).key, kept[0].data)  # swapped
        damaged = make_kept(31, PAGE_MS + 64_000)
        await store.put(name_segment(damaged).key, damaged.data[:-1])

    asyncio.run(keep())
    recording = export(tmp_path)
    assert [each.index for each in recording.segments] == [0, 1, 4, 5, 6, 7, 8, 9, 20, 21, 22]
    said = list_lost(capsys)
    assert len(said) == 2
    take = kept[0].name.take
    assert f"segments/{take:016x}/30.segment: is of r/public, take {take:016x}, index 0" in said[0]
    assert f"segments/{take:016x}/31.segment: byte " in said[1]
    one = export(tmp_path, "--from", "2026-11-21T11:25Z", "--to", "2026-11-21T11:35Z")
    assert [each.index for each in one.segments] == [21]


def test_what_is_empty_is_passed_over_as_damaged(
    tmp_path: Path, store: ObjectStore, capsys: pytest.CaptureFixture[str]
) -> None:
    model = KeptModel({"a.glb": (b"12345", "")})
    kept = record(20.0, model.name)
    asyncio.run(fill(store, kept))
    asyncio.run(store.put(name_segment(kept[1]).key, b""))
    asyncio.run(store.put(make_model_key("r", model.name, "manifest.json"), model.manifest))
    asyncio.run(store.put(make_model_key("r", model.name, "a.glb"), b""))
    assert len(export(tmp_path).segments) == len(kept) - 1
    said = list_lost(capsys)
    assert len(said) == 2
    assert "/1.segment: byte 0: " in said[0]
    assert said[1].endswith(f"models/{model.name}/a.glb: no longer kept")
    asyncio.run(store.put(make_model_key("r", model.name, "manifest.json"), b""))
    assert len(export(tmp_path).segments) == len(kept) - 1
    assert capsys.readouterr().err.splitlines()[1].endswith("/manifest.json: no longer kept")
    schema = kept[0].schema
    assert schema is not None
    asyncio.run(store.put(make_schema_key("r", schema), b""))
    with pytest.raises(SystemExit):
        export(tmp_path)
    assert "its schema is missing" in capsys.readouterr().err


async def test_the_span_is_from_the_first_day_to_the_last(store: ObjectStore) -> None:
    source = StoreSource(store, "r", "public", Audience.ANYONE)
    assert await source.find_span() is None
    kept = [make_kept(i, PAGE_MS + i * DAY_MS) for i in range(5)]
    hidden = [make_kept(9, PAGE_MS + 9 * DAY_MS, audiences=frozenset((Audience.LINK,)))]
    await fill(store, [*kept, *hidden])
    found = await StoreSource(store, "r", "public", Audience.ANYONE).find_span()
    assert found == (PAGE_MS, PAGE_MS + 4 * DAY_MS + 4000)
    assert await StoreSource(store, "r", "lab", Audience.ANYONE).find_span() is None


async def test_what_has_another_hash_is_not_there(store: ObjectStore) -> None:
    source = StoreSource(store, "r", "public", Audience.ANYONE)
    text = SCHEMA.text.encode()
    await store.put(make_schema_key("r", SCHEMA_HASH), text)
    assert await source.load_schema(SCHEMA_HASH.hex()) == SCHEMA.text
    await store.put(make_schema_key("r", SCHEMA_HASH), text[:-1])
    assert await source.load_schema(SCHEMA_HASH.hex()) is None
    model = KeptModel({"a.glb": (b"12345", "")})
    sha256 = hashlib.sha256(b"12345").hexdigest()
    assert await source.load_manifest(model.name) is None
    await store.put(make_model_key("r", model.name, "manifest.json"), model.manifest)
    await store.put(make_model_key("r", model.name, "a.glb"), b"123456")
    assert await source.load_manifest(model.name) == model.manifest
    assert await source.load_model_file(model.name, "a.glb", sha256, 5) is None
    await store.put(make_model_key("r", model.name, "a.glb"), b"12345")
    assert await source.load_model_file(model.name, "a.glb", sha256, 5) == b"12345"


def test_a_store_that_says_no_is_one_line(
    tmp_path: Path, store: ObjectStore, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        export(tmp_path)
    assert caught.value.code == 1
    assert "r/public, from 2026-01-01T" in capsys.readouterr().err
    asyncio.run(fill(store, [make_kept(0, PAGE_MS)]))
    (file,) = (path for path in list_files(tmp_path / "store") if path.endswith(".segment"))
    (tmp_path / "store" / file).unlink()
    (tmp_path / "store" / file).mkdir()
    with pytest.raises(SystemExit):
        export(tmp_path)
    assert "nothing was recorded in this span; it has no recording at all" in capsys.readouterr().err


def test_an_end_while_it_is_written_leaves_nothing(tmp_path: Path, store: ObjectStore) -> None:
    asyncio.run(fill(store, record(4.0)))
    command = """
import os, signal, sys
from posecast_relay.past_command import export, main

export.pack_recording = lambda *_: os.kill(os.getpid(), signal.SIGTERM)
main.run_past(sys.argv[1:], {})
"""
    asked = ["export", "--robot", "r", "--from", "2026-01-01", "--to", "2099-01-01"]
    asked += ["--past", f"file://{tmp_path}/store", "-o", str(tmp_path / "x.posecast")]
    done = subprocess.run(
        [sys.executable, "-c", command, *asked], capture_output=True, text=True, timeout=60, check=False
    )
    said = f"posecast-relay: {tmp_path}/x.posecast: interrupted; no files were left behind\n"
    assert (done.returncode, done.stdout, done.stderr) == (1, "", said)
    assert os.listdir(tmp_path) == ["store"]
