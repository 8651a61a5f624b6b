"""Source `demo`: a one-minute motion of a humanoid robot made for this project, repeated for ever.

It has its own profile and model. `edge-agent/demo/build.py` makes the bundle (URDF, meshes, motion);
packing.py there describes how the motion is stored.
"""

from __future__ import annotations

import json
import sys
import threading
import time
import zlib
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING

from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.base import Defaults, Deliver, Source

if TYPE_CHECKING:
    from posecast_edge.profile.types import Profile

PACKAGE = Path(__file__).resolve().parent.parent
PROFILE = PACKAGE / "profiles" / "demo.toml"
BUNDLE = PACKAGE / "demo_bundle"
HOW = f"build it with: python edge-agent/demo/build.py --out {BUNDLE}"

MAGIC = b"posecast-motion 1\n"
MISSING = -32768
MAX_BEHIND_S = 1.0  # after a suspend, continue where it stopped


def find_defaults(address: str) -> Defaults:
    """The demo's profile and model: the built model if it exists. Raises SourceError when the bundle is
    missing."""
    del address
    urdf = BUNDLE / "robot.urdf"
    if not urdf.is_file():
        raise SourceError(f"the demo robot is missing ({BUNDLE}): {HOW}")
    model = BUNDLE / "model"
    return Defaults(PROFILE, urdf, model if (model / "manifest.json").is_file() else None)


def open_source(address: str, profile: Profile | None) -> Source:
    """Open the demo. Raises SourceError when an address is given or the bundle has not been built."""
    del profile  # labels are matched later, for samples of every source
    if address:
        raise SourceError(f"demo takes no address, not {address!r}")
    path = BUNDLE / "motion.bin"
    try:
        return DemoSource(read_motion(path.read_bytes()))
    except OSError:
        raise SourceError(f"the demo robot is missing ({BUNDLE}): {HOW}") from None
    except (ValueError, KeyError, TypeError, zlib.error) as e:
        raise SourceError(f"{path}: not a motion of this version ({e}): {HOW}") from None


@dataclass(frozen=True)
class Track:
    """The samples of one field: one int16 column per label. `scale`: units per count, 1 for bit masks.

    `gaps`: whether some counts are MISSING.
    """

    name: str
    scale: float
    columns: tuple[Sequence[int], ...]
    gaps: bool


@dataclass(frozen=True)
class Motion:
    """A motion that is repeated. `phases`: (start in seconds, mode of the robot), in order of time."""

    rate_hz: float
    samples: int
    tracks: tuple[Track, ...]
    phases: tuple[tuple[float, str], ...]

    @property
    def period_s(self) -> float:
        """Length of the motion in seconds."""
        return self.samples / self.rate_hz

    def make_sample(self, index: int) -> Sample:
        """The sample with this index, counted from the start; robot time continues from one repetition to the
        next."""
        k = index % self.samples
        values: dict[str, list[float | int | None]] = {}
        for track in self.tracks:
            scale = track.scale
            if scale == 1:
                values[track.name] = [column[k] for column in track.columns]
            elif track.gaps:
                values[track.name] = [
                    None if column[k] == MISSING else column[k] * scale for column in track.columns
                ]
            else:
                values[track.name] = [column[k] * scale for column in track.columns]
        mode = next((m for start, m in reversed(self.phases) if start <= k / self.rate_hz), "")
        return Sample(index / self.rate_hz, values, {"mode": mode})


def read_motion(content: bytes) -> Motion:
    """Parse the content of motion.bin. Raises ValueError, KeyError, TypeError or zlib.error when it is
    invalid."""
    if not content.startswith(MAGIC):
        raise ValueError("wrong first line")
    end = content.index(b"\n", len(MAGIC))
    head = json.loads(content[len(MAGIC) : end])
    n = int(head["samples"])
    planes = zlib.decompress(content[end + 1 :])
    channels = sum(len(f["labels"]) for f in head["fields"])
    if n < 1 or len(planes) != channels * n * 2:
        raise ValueError(f"{len(planes)} bytes for {channels} channels")
    tracks, start = [], 0
    for f in head["fields"]:
        columns = []
        for _ in f["labels"]:
            columns.append(_column(planes[start : start + n], planes[start + n : start + 2 * n]))
            start += 2 * n
        gaps = any(MISSING in column for column in columns)
        tracks.append(Track(str(f["name"]), float(f["scale"]), tuple(columns), gaps))
    phases = tuple((float(start_s), str(mode)) for start_s, mode in head["phases"])
    return Motion(float(head["rate_hz"]), n, tuple(tracks), phases)


def _column(low: bytes, high: bytes) -> array[int]:
    """Planes of low and high bytes → counts: differences modulo 2^16, added up."""
    pairs = bytearray(2 * len(low))
    pairs[0::2], pairs[1::2] = low, high
    steps = array("h", bytes(pairs))
    if sys.byteorder == "big":
        steps.byteswap()
    return array("h", accumulate(steps, lambda a, b: (a + b + 32768) % 65536 - 32768))


class DemoSource:
    """Plays a motion in real time on the monotonic clock."""

    def __init__(self, motion: Motion) -> None:
        self.description = f"demo, a loop of {motion.period_s:g} s"
        self._motion = motion

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Deliver every sample when it is due until `stop`; when late, deliver only the newest one that is
        due."""
        rate_hz = self._motion.rate_hz
        start_s, index = time.monotonic(), 0
        while not stop.is_set():
            deliver(self._motion.make_sample(index))
            due = int((time.monotonic() - start_s) * rate_hz)
            if due - index > MAX_BEHIND_S * rate_hz:
                start_s, due = start_s + (due - index) / rate_hz, index
            index = max(index + 1, due)
            stop.wait(max(0.0, start_s + index / rate_hz - time.monotonic()))
