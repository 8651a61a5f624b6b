"""The guide's gallery: four recordings that show what their captions say, small, and with one player."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import cast
from urllib.parse import urlsplit

import numpy as np
import pytest
from PIL import Image
from posecast_edge.profile.schema import infer_profile
from posecast_edge.sources.demo import BUNDLE
from posecast_relay.config.settings import find_page
from posecast_relay.export.link_poses import LinkPose
from posecast_relay.export.rotation import rotate_vector
from posecast_wire import Decoder
from posecast_wire.recording import PastRecording, decode_recording, model_path, segment_path, unpack_segment
from posecast_wire.segment import FrameRecord, decode_segment

from tools.site.moments import drone
from tools.site.moments.gallery import place_moments
from tools.site.moments.moments import DRONE, MOMENTS
from tools.site.moments.simulated_relay import RecordingFailed, record_samples

RECORDINGS_BYTES_MAX = 1_000_000
PLAYER_BYTES_MAX = 2_150_000  # a quarter of it is three.js, all of it
POSTER_BYTES_MAX = 20_000
PLACE = '<div class="moment" data-moment="{}"></div>'
ADDRESS = re.compile(r'\b(?:href|src|content)="([^"]*)"')
RECORDING = re.compile(r'<meta name="posecast-recording" content="([^"]+)" />')
NAMES = [moment.name for moment in MOMENTS]

pytestmark = [
    pytest.mark.docs,
    pytest.mark.skipif(find_page() is None, reason="no built page: run make setup"),
    pytest.mark.skipif(not (BUNDLE / "model").exists(), reason="no demo robot: run make setup"),
]


def write_places(site: Path, *names: str) -> Path:
    page = site / "gallery.html"
    page.write_text(f"<html><body>{''.join(PLACE.format(name) for name in names)}</body></html>")
    return page


def read(site: Path, name: str) -> PastRecording:
    return decode_recording((site / f"gallery/{name}.json").read_bytes())


def bases(site: Path, name: str) -> Iterator[tuple[float, LinkPose]]:
    """When, in seconds of the recording, and where the root link was and how it was turned."""
    recording, decoder = read(site, name), Decoder()
    (text,) = recording.schemas.values()
    (labels,) = (field.labels for field in decoder.add_schema(text).fields if field.name == "baseq")
    for each in recording.segments:
        data = (site / "gallery" / segment_path(each.take, each.index)).read_bytes()
        segment = decode_segment(unpack_segment(data))
        for record in segment.records:
            if isinstance(record, FrameRecord):
                at_s = (segment.start.from_ms - recording.from_ms) / 1000 + record.at_us / 1e6
                frame = decoder.decode(record.frame)
                x, y, z = (v or 0.0 for v in frame.values("base"))
                turn = dict(zip(labels, frame.values("baseq"), strict=True))
                w, i, j, k = (turn[f"base.{axis}"] or 0.0 for axis in "wxyz")
                yield at_s, LinkPose((x, y, z), (w, i, j, k))


def test_each_moment_is_a_recording_of_its_span(site: Path) -> None:
    assert len(MOMENTS) == 4
    for moment in MOMENTS:
        recording = read(site, moment.name)
        assert recording.robot == moment.robot
        assert recording.title == moment.title
        assert recording.to_ms - recording.from_ms == pytest.approx(
            1000 * (moment.to_s - moment.from_s), abs=40
        )
        assert {note.text for note in recording.notes} == {*moment.notes.values()}
        for note in recording.notes:
            assert recording.from_ms < note.at_ms < recording.to_ms
        for each in recording.segments:
            assert each.missing == 0
            assert (site / "gallery" / segment_path(each.take, each.index)).is_file()
        (model,) = recording.models
        assert (site / "gallery" / model_path(model, "manifest.json")).is_file()


def test_recordings_and_player_are_small_and_there_once(site: Path) -> None:
    gallery = site / "gallery"
    sizes = {path.relative_to(gallery): path.stat().st_size for path in gallery.rglob("*") if path.is_file()}
    recorded = ("segments", "keys", "models", *NAMES, *(f"{name}.json" for name in NAMES))
    assert sum(size for path, size in sizes.items() if path.parts[0] in recorded) <= RECORDINGS_BYTES_MAX
    assert sum(size for path, size in sizes.items() if path.parts[0] not in recorded) <= PLAYER_BYTES_MAX
    for kind in ("assets/index-*.js", "assets/threejs-*.js"):
        assert len([*gallery.rglob(kind)]) == 1, kind
    assert len([*(gallery / "models").iterdir()]) == 2, "the demo's moments share its model"
    assert not [path for path in sizes if path.suffix in (".br", ".gz")]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("entry", ["index.html", "embed/index.html"])
def test_its_pages_load_what_lies_in_the_site(site: Path, name: str, entry: str) -> None:
    page = site / "gallery" / name / entry
    text = page.read_text(encoding="utf-8")
    (recording,) = RECORDING.findall(text)
    assert (page.parent / recording).resolve() == (site / f"gallery/{name}.json").resolve()
    loaded = [address for address in ADDRESS.findall(text) if address.startswith(".")]
    assert len(loaded) > 5
    for address in loaded:
        assert (page.parent / address).resolve().is_file(), address
    assert not [address for address in ADDRESS.findall(text) if urlsplit(address).scheme in ("http", "https")]
    built = find_page()
    assert built is not None
    policy = re.search(r"<meta http-equiv=\"Content-Security-Policy\"[^>]*>", (built / entry).read_text())
    assert policy is not None
    assert policy[0] in text


def test_the_page_shows_a_poster_of_each(site: Path) -> None:
    text = (site / "gallery.html").read_text(encoding="utf-8")
    assert re.findall(r'data-frame="gallery/(\w+)/embed/index.html"', text) == NAMES
    assert text.count('<script src="look/gallery.js" defer>') == 1
    for name in NAMES:
        data = (site / f"gallery/{name}/poster.webp").read_bytes()
        assert len(data) <= POSTER_BYTES_MAX
        pixels = np.asarray(Image.open(io.BytesIO(data)).convert("RGBA"))
        assert 0.05 < (pixels[..., 3] > 127).mean() < 0.8, name
    assert 'url=../gallery.html"' in (site / "gallery/index.html").read_text()


def test_a_page_with_other_places_than_moments_is_refused(tmp_path: Path) -> None:
    for names in (NAMES[:-1], [*NAMES, "dance"], [*NAMES, NAMES[0]]):
        with pytest.raises(RecordingFailed, match=r"docs/gallery\.md: places for"):
            place_moments(write_places(tmp_path, *names))


def test_it_walks(site: Path) -> None:
    _, first = next(bases(site, "walking"))
    *_, (_, last) = bases(site, "walking")
    assert math.dist(first.xyz, last.xyz) == pytest.approx(5 * 0.16, abs=0.05)


def test_its_knee_jams_and_is_freed(site: Path) -> None:
    told = [
        (event.event["source"], event.event["text"], event.event["state"])
        for each in read(site, "knee").segments
        for event in each.events
    ]
    assert told.index(("RKN", "jam", "on")) < told.index(("RKN", "jam", "off"))


def test_it_leans_and_comes_back(site: Path) -> None:
    pitches = [math.asin(-rotate_vector(pose.quat, (1, 0, 0))[2]) for _, pose in bases(site, "lean")]
    assert pitches[0] == pytest.approx(0, abs=0.02)
    assert max(pitches) == pytest.approx(0.16, abs=0.01)
    assert pitches[-1] == pytest.approx(0, abs=0.02)


def test_the_drone_flies_tilts_into_the_gust_and_lands(site: Path) -> None:
    flown = [*bases(site, "drone")]
    assert flown[0][1].xyz == flown[-1][1].xyz == pytest.approx((0, 0, drone.GROUND_M), abs=0.05)
    assert max(pose.xyz[2] for _, pose in flown) == pytest.approx(drone.HEIGHT_M + drone.GROUND_M, abs=0.2)
    assert max(pose.xyz[1] for _, pose in flown) == pytest.approx(2 * drone.RADIUS_M, abs=0.25)
    gust = [pose for at_s, pose in flown if drone.GUST_S < at_s < drone.CALM_S]
    up = [rotate_vector(pose.quat, (0, 0, 1)) for pose in gust]
    assert min(pose.xyz[1] for pose in gust) < -0.1, "it is blown to its right"
    assert max(y for _, y, _ in up) > 0.4, "and leans to its left"


def test_the_drone_obeys_its_own_laws() -> None:
    for sample in drone.fly(0.0, 14.0):
        base, quat, acc = (cast("dict[str, float]", sample.values[name]) for name in ("base", "baseq", "acc"))
        assert sum(v * v for v in quat.values()) == pytest.approx(1)
        felt = math.hypot(*acc.values())
        if sample.t_s < drone.UP_S:
            assert acc["imu.z"] == pytest.approx(9.81), "at rest it feels the floor"
        assert 3 < felt < 20
        assert base["base.z"] >= drone.GROUND_M


def test_the_same_samples_give_the_same_bytes() -> None:
    profile = infer_profile(DRONE, next(drone.fly(0.0, 0.0)))
    one, other = (record_samples(DRONE, profile, drone.fly(0.0, 5.0), "0d" * 32, 10**12) for _ in range(2))
    assert [each.data for each in one] == [each.data for each in other]
    assert sum(each.frames for each in one) > 100


def test_what_a_recording_leaves_out_is_no_recording() -> None:
    profile = infer_profile(DRONE, next(drone.fly(0.0, 0.0)))
    samples = (sample._replace(values={**sample.values, "odd": [1.0]}) for sample in drone.fly(0.0, 0.2))
    with pytest.raises(RecordingFailed, match=r"drone: .*odd"):
        record_samples(DRONE, profile, samples, "0d" * 32, 10**12)
