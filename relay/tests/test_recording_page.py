"""The page in a recording's folder: it is told what to play, and lacks what only a relay needs."""

from __future__ import annotations

import argparse
import re
import struct
import zlib
from pathlib import Path

import pytest
from posecast_relay.past_command.export import add_arguments
from posecast_relay.recording.output import PAGE_FILES, PAGE_FOLDERS, OutputError
from posecast_relay.recording.page import add_page, check_page, unpacks_segments
from posecast_wire.recording import PastRecording

from .past_doors import PAGE_MS, make_kept
from .recording_stage import KeptModel, KeptSource, collect, describe, list_files, make_page
from .test_recording_collector import record

REPOSITORY = Path(__file__).resolve().parents[2]


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


PNG = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 256, 128, 8, 2, 0, 0, 0))


def tags(html: str) -> dict[str, str]:
    """What stands in the head, by name."""
    return dict(re.findall(r'<meta (?:name|property)="([^"]+)" content="([^"]*)"', html))


def exported(
    folder: Path, title: str | None, model: KeptModel | None = None, address: str | None = None
) -> PastRecording:
    """A folder with a page."""
    kept = [make_kept(0, PAGE_MS)] if model is None else record(2.0, model.name)
    models = [] if model is None else [model]
    recording, _ = collect(KeptSource(kept, models), folder, about=describe(title))
    add_page(make_page(folder.parent / "page"), folder, recording, address)
    return recording


def test_both_entries_name_the_recording(tmp_path: Path) -> None:
    exported(tmp_path / "to", "Walking")
    index, embed = ((tmp_path / "to" / name).read_text() for name in ("index.html", "embed/index.html"))
    assert tags(index)["posecast-recording"] == "recording.json"
    assert tags(embed)["posecast-recording"] == "../recording.json"
    assert 'async src="./assets/early-1.js"' in index  # asks for recording.json, early
    for html in (index, embed):
        assert html.count("<title>") == html.count("posecast-recording") == html.count("og:title") == 1
        assert "<title>Walking · Posecast</title>" in html
        assert "index-1.js" in html
    assert 'data-page="embed"' in embed


def test_what_only_a_relay_or_the_build_needs_is_left_out(tmp_path: Path) -> None:
    exported(tmp_path / "to", None)
    of_page = [name for name in list_files(tmp_path / "to") if not re.match(r"segments|keys|recording", name)]
    assert of_page == [
        "assets/early-1.js",
        "assets/index-1.js",
        "embed/index.html",
        "icon-512.png",
        "index.html",
    ]


def test_a_chat_is_shown_title_and_picture(tmp_path: Path) -> None:
    model = KeptModel({"small.png": (PNG, "image/png")}, thumbnail="small.png")
    exported(tmp_path / "to", '<b>"Walk" & co\u202e</b>', model, "https://uni.example/lecture/7/")
    html = (tmp_path / "to/index.html").read_text()
    found = tags(html)
    assert found["og:title"] == "&lt;b&gt;&quot;Walk&quot; &amp; co\\u{202e}&lt;/b&gt;"
    assert f"<title>{found['og:title']} · Posecast</title>" in html
    assert found["og:url"] == "https://uni.example/lecture/7/"
    assert found["og:image"] == f"https://uni.example/lecture/7/models/{model.name}/small.png"
    assert (found["og:image:width"], found["og:image:height"]) == ("256", "128")
    assert re.fullmatch(
        r"A robot recorded on \d+ \w+ 20\d\d, 0:0\d minutes\. A\. Kim\. CC BY 4\.0\.", found["og:description"]
    )
    assert found["description"] == found["og:description"]


def test_without_a_title_the_robots_name_and_without_a_picture_ours(tmp_path: Path) -> None:
    no_picture = KeptModel({"small.png": (b"none", "image/png")}, thumbnail="small.png")
    exported(tmp_path / "to", None, no_picture)
    found = tags((tmp_path / "to/embed/index.html").read_text())
    assert found["og:title"] == "sim"  # as its schema has it
    assert found["og:image"] == "../icon-512.png"
    assert "og:url" not in found


@pytest.mark.skipif(not (REPOSITORY / "spa/dist/index.html").exists(), reason="no built page")
def test_the_built_page_is_one(tmp_path: Path) -> None:
    check_page(REPOSITORY / "spa/dist")
    recording, _ = collect(KeptSource([make_kept(0, PAGE_MS)]), tmp_path / "to")
    add_page(REPOSITORY / "spa/dist", tmp_path / "to", recording, None)
    for name, at in (("index.html", "."), ("embed/index.html", "..")):
        html = (tmp_path / "to" / name).read_text()
        assert tags(html)["posecast-recording"] == f"{'../' if at == '..' else ''}recording.json"
        for path in re.findall(r'(?:href|src)="([^"]+)"', html):  # relative, and there
            assert (tmp_path / "to" / name).parent.joinpath(path).is_file(), path


def test_all_of_the_page_is_known() -> None:
    build, ours = REPOSITORY / "spa", PAGE_FILES | PAGE_FOLDERS | {"docs", "guide", "config.json", ".vite"}
    for folder in (build / "public", build / "dist"):
        names = {path.name for path in folder.glob("*") if path.suffix not in (".br", ".gz")}
        assert names <= ours


def test_a_build_tells_whether_it_unpacks_segments(tmp_path: Path) -> None:
    page = make_page(tmp_path / "page")
    assert not unpacks_segments(page)
    (page / "assets/zip-1.js").write_text('new DecompressionStream("deflate-raw")')
    assert not unpacks_segments(page)
    source = (REPOSITORY / "wire/typescript/src/recording/packed.ts").read_text()
    for quote in "'\"`":
        (page / "assets/past-1.js").write_text(source.replace("'", quote))
        assert unpacks_segments(page)


@pytest.mark.parametrize(
    "address", ["https://uni.example/7?x=1", "https://uni.example/#7", "ftp://x", "https://"]
)
def test_an_address_to_which_no_path_can_be_added(address: str) -> None:
    parser = argparse.ArgumentParser(exit_on_error=False)
    add_arguments(parser, {})
    with pytest.raises(argparse.ArgumentError) as caught:
        parser.parse_args(["--url", address])
    assert str(caught.value) == "argument --url: use https://HOST/PATH, without ? and #"


def test_another_folder_is_none(tmp_path: Path) -> None:
    page = make_page(tmp_path / "page")
    check_page(page)
    (page / "embed/index.html").write_text("<title>Other</title>")
    with pytest.raises(OutputError) as caught:
        check_page(page)
    assert str(caught.value) == f"--page {page}: not a built page: embed/index.html is not Posecast's"
    with pytest.raises(OutputError):
        check_page(tmp_path)
