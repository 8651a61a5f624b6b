"""Records a robot's samples as agent and relay do, by a clock of its own: ten seconds take a tenth of one."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from posecast_edge.model.serve.bundle import RANGE_MAX, Bundle
from posecast_edge.pipeline.events import Event
from posecast_edge.pipeline.stream import Frame, Stream
from posecast_edge.profile.types import Profile
from posecast_edge.sample import Sample
from posecast_edge.uplink.publisher import make_event_document
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.core.policy import PUBLIC, Audience, Policy
from posecast_relay.past.recorder import Recorder, RecordingPorts
from posecast_relay.past.segment import KeptSegment
from posecast_relay.recording.source import ListedSegment, SourceSpan
from posecast_wire.keys import Stamp

HZ = 30.0  # of frames
KEY_INTERVAL_S = 4.0
SLACK_S = 1e-6  # in which two times are the same


class RecordingFailed(Exception):
    """A robot's samples can't be recorded. The message is one line."""


class _Relay:
    """A hub that records. `now_s` is set by the caller; it is the agent's clock as well."""

    def __init__(self, robot: str, from_ms: int) -> None:
        self.segments: list[KeptSegment] = []
        self.now_s = 0.0
        self._is_described = False  # by a snapshot, which has schema and model
        self._robot, self._from_s = robot, from_ms / 1000
        self._run_id, take = (_draw(f"{robot} {from_ms} {what}") for what in ("run", "take"))
        draw = itertools.count(take)
        ports = RecordingPorts(
            lambda segment, _now: self.segments.append(segment), lambda: next(draw), self._read_unix_s
        )
        self._recorder = Recorder(ports, lambda *_: frozenset({Audience.ANYONE}))
        self._recorder.set_policy(Policy(), self.now_s)
        self._hub = Hub(Limits(), recorder=self._recorder)
        self._hub.set_token(robot, True, self.now_s)

    def take_event(self, event: Event) -> None:
        payload = json.dumps(make_event_document(event)).encode()
        self._hub.take_event(
            self._robot, PUBLIC, payload, self._make_stamp(), self.now_s, self._read_unix_s()
        )

    def take_frame(self, frame: Frame, stream: Stream, model: str) -> None:
        stamp = self._make_stamp()
        self._hub.take_edge_frame(self._robot, PUBLIC, frame.data, stamp, self.now_s)
        snapshot = None if self._is_described else stream.make_snapshot(model, self.now_s)
        if snapshot is not None:
            self._hub.take_snapshot(self._robot, PUBLIC, snapshot, stamp, self.now_s)
            self._is_described = True

    def close(self) -> list[KeptSegment]:
        """Raises RecordingFailed."""
        self._recorder.close_all(self.now_s)
        for place, error in self._recorder.take_faults():
            raise RecordingFailed(f"{place}: {error!r}")
        return self.segments

    def _make_stamp(self) -> Stamp:
        return Stamp(self._run_id, round(self.now_s * 1e9))

    def _read_unix_s(self) -> float:
        return self._from_s + self.now_s


def record_samples(
    robot: str, profile: Profile, samples: Iterable[Sample], model: str, from_ms: int
) -> list[KeptSegment]:
    """The segments that a relay keeps of these samples. `model`: SHA-256 of its manifest; `from_ms`: when the
    first sample is said to come, unix. The same samples give the same bytes. Raises RecordingFailed.
    """
    complaints: list[str] = []
    stream = Stream(profile, KEY_INTERVAL_S, complaints.append)
    relay = _Relay(robot, from_ms)
    began_s: float | None = None
    due_s = 0.0
    for sample in samples:
        began_s = sample.t_s if began_s is None else began_s
        relay.now_s = now_s = sample.t_s - began_s
        for event in stream.deliver(sample, now_s):
            relay.take_event(event)
        if now_s < due_s - SLACK_S:
            continue
        due_s += 1 / HZ
        frame = stream.tick(now_s)
        if frame is not None:
            relay.take_frame(frame, stream, model)
    if complaints:
        raise RecordingFailed(f"{robot}: {complaints[0]}")
    return relay.close()


def _draw(seed: str) -> int:
    """A u64 that is the same each time."""
    return int.from_bytes(hashlib.sha256(seed.encode()).digest()[:8], "big")


@dataclass(frozen=True)
class RecordedPast:
    """What has been recorded of a robot, for an export (see RecordingSource)."""

    robot: str
    segments: Sequence[KeptSegment]
    bundle: Bundle
    view: str = PUBLIC

    async def find_span(self) -> SourceSpan | None:
        """Return from when to when there is something."""
        return SourceSpan(self.segments[0].from_ms, self.segments[-1].to_ms)

    async def list_segments(self, from_ms: int, to_ms: int) -> list[ListedSegment]:
        """Return the segments that begin in the span."""
        return [
            ListedSegment(each.name.take, each.name.index, each.from_ms, each.to_ms, each.sha256.hex())
            for each in self.segments
            if from_ms <= each.from_ms < to_ms
        ]

    async def load_segment(self, segment: ListedSegment) -> bytes | None:
        """Return a segment's bytes."""
        return next(each.data for each in self.segments if each.name.index == segment.index)

    async def load_schema(self, sha256: str) -> str | None:
        """Return the schema's text."""
        return next((s.schema_text for s in self.segments if s.schema and s.schema.hex() == sha256), None)

    async def load_manifest(self, model: str) -> bytes | None:
        """Return the model's manifest."""
        return self.bundle.manifest if model == self.bundle.hash else None

    async def load_model_file(self, model: str, path: str, sha256: str, size: int) -> bytes | None:
        """Return a file of the model, by its SHA-256."""
        del model, path
        parts = (self.bundle.read(sha256, at, RANGE_MAX) for at in range(0, size, RANGE_MAX))
        return b"".join(parts)

    async def close(self) -> None:
        """Nothing is held open."""
