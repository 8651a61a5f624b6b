"""Adds the recorded moments to the built guide: the recordings, their player, and posters in the page."""

from __future__ import annotations

import asyncio
import html
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from posecast_edge.model.builder.build import build_model
from posecast_edge.model.robot_file import load_robot_file
from posecast_edge.model.serve.bundle import Bundle, load_built
from posecast_edge.model.serve.bundle_dir import MANIFEST, write_folder
from posecast_edge.model.urdf.resolver import Resolver
from posecast_edge.profile.reader import load_profile
from posecast_edge.profile.schema import infer_profile
from posecast_edge.profile.types import Profile
from posecast_edge.sample import Sample
from posecast_edge.sources.demo import BUNDLE, PROFILE, read_motion
from posecast_relay.recording.collector import Collector, Description
from posecast_relay.recording.page import ENTRIES, GENERAL, TITLE, copy_page_files, unpacks_segments
from posecast_wire.recording import RECORDING_FILE, RecordingNote

from tools.site.moments import drone
from tools.site.moments.moments import DEMO, DRONE, MOMENTS, Moment
from tools.site.moments.poster import SIDE, draw_poster
from tools.site.moments.simulated_relay import RecordedPast, RecordingFailed, record_samples

FOLDER = "gallery"
PAGE = "gallery.html"
FROM_MS = 1_793_620_800_000  # 2026-11-02T12:00Z: fixed, so that the same robot makes the same files
STEP_MS = 600_000  # from moment to moment: each has a page of KEYs of its own, in the folder of all
PLACE = re.compile(r'<div class="moment" data-moment="(?P<name>[a-z]*)">\s*</div>')
ADDRESS = re.compile(r'((?:href|src)=")(?:\./)?')  # of what lies beside the page
REDIRECT = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Gallery</title>
<link rel="icon" href="favicon.svg"><meta http-equiv="refresh" content="0; url=../gallery.html"></head>
<body><a href="../gallery.html">Gallery</a></body></html>
"""


class Robot(NamedTuple):
    """Whose moments are recorded."""

    profile: Profile
    bundle: Bundle


def add_gallery(site: Path, page: Path) -> None:
    """Add the moments to a built guide. `page`: the built page, whose player they are played with.

    Raises RecordingFailed, ModelError, or OSError.
    """
    folder = site / FOLDER
    copy_page_files(page, folder)
    with TemporaryDirectory() as temporary:
        robots = {
            DEMO: Robot(load_profile(PROFILE), load_built(BUNDLE / "model")),
            DRONE: Robot(
                infer_profile(DRONE, next(drone.fly(0.0, 0.0))), build_bundle(drone.URDF, Path(temporary))
            ),
        }
        for number, moment in enumerate(MOMENTS):
            add_moment(moment, robots[moment.robot], FROM_MS + number * STEP_MS, page, folder)
    place_moments(site / PAGE)
    (folder / "index.html").write_text(REDIRECT, encoding="utf-8")


def add_moment(moment: Moment, robot: Robot, from_ms: int, page: Path, folder: Path) -> None:
    """Record a moment and write all that it has. Raises RecordingFailed or OSError."""
    samples = list_samples(moment)
    segments = record_samples(moment.robot, robot.profile, samples, robot.bundle.hash, from_ms)
    notes = [
        RecordingNote(from_ms + round(1000 * (at - moment.from_s)), moment.notes[at]) for at in moment.notes
    ]
    about = Description(moment.title, None, None, lambda *_: notes)
    collector = Collector(
        RecordedPast(moment.robot, segments, robot.bundle), folder, packs=unpacks_segments(page)
    )
    asyncio.run(collector.collect(from_ms, segments[-1].to_ms, about))
    if collector.found.lost:
        raise RecordingFailed(f"{moment.name}: {collector.found.lost[0]}")
    (folder / RECORDING_FILE).rename(folder / f"{moment.name}.json")
    add_entries(page, folder, moment.name, moment.title)
    at_ms = from_ms + round(1000 * (moment.poster_s - moment.from_s))
    (folder / moment.name / "poster.webp").write_bytes(draw_poster(robot.bundle, segments, at_ms, moment.eye))


def add_entries(page: Path, folder: Path, name: str, title: str) -> None:
    """Write `NAME/index.html` and `NAME/embed/index.html`, which play `NAME.json` of the same folder with the
    player there."""
    for entry, home in ENTRIES.items():
        text = GENERAL.sub("", (page / entry).read_text(encoding="utf-8"))
        text = ADDRESS.sub(r"\1../", text)
        meta = f'<meta name="posecast-recording" content="{home}../{name}.json" />'
        text = text.replace(TITLE, f"{meta}\n    <title>{html.escape(title)} · Posecast</title>", 1)
        place = folder / name / entry
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text, encoding="utf-8")


def list_samples(moment: Moment) -> Iterator[Sample]:
    """What its robot reports from beginning to end."""
    if moment.robot == DRONE:
        yield from drone.fly(moment.from_s, moment.to_s)
        return
    motion = read_motion((BUNDLE / "motion.bin").read_bytes())
    for index in range(round(moment.from_s * motion.rate_hz), round(moment.to_s * motion.rate_hz) + 1):
        yield motion.make_sample(index)


def build_bundle(urdf: Path, folder: Path) -> Bundle:
    """Build a robot's model into a folder."""
    built = build_model(load_robot_file(urdf, (), {}), Resolver(urdf, ()), lambda *_: None)
    write_folder(folder, {**built.files, MANIFEST: built.manifest})
    return load_built(folder)


def place_moments(page: Path) -> None:
    """Put a poster into each place of the page, which is `<div class="moment" data-moment="NAME"></div>`.

    Raises RecordingFailed when the page's places are not those of the moments.
    """
    moments: Mapping[str, Moment] = {moment.name: moment for moment in MOMENTS}
    text = page.read_text(encoding="utf-8")
    named: Sequence[str] = PLACE.findall(text)
    if sorted(named) != sorted(moments):
        raise RecordingFailed(f"docs/gallery.md: places for {named}, and moments {list(moments)}")
    text = PLACE.sub(lambda found: _write_poster(moments[found["name"]]), text)
    script = '<script src="look/gallery.js" defer></script></body>'
    page.write_text(text.replace("</body>", script, 1), encoding="utf-8")


def _write_poster(moment: Moment) -> str:
    at = f"{FOLDER}/{moment.name}"
    title = html.escape(moment.title)
    return (
        f'<div class="moment"><a href="{at}/index.html" data-frame="{at}/embed/index.html" '
        f'data-title="{title}">'
        f'<img src="{at}/poster.webp" alt="" width="{SIDE}" height="{SIDE}">'
        f"<span>Play: {title}</span></a></div>"
    )
