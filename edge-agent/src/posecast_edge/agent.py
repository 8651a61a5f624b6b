"""Source thread, clock and link, wired together."""

from __future__ import annotations

import logging
import threading
import time

from posecast_wire.keys import Snapshot
from posecast_wire.schema import SchemaError

from posecast_edge.complaints import Complaints
from posecast_edge.console import Console
from posecast_edge.echo import RateControl
from posecast_edge.events import Event
from posecast_edge.model.bundle import Bundle
from posecast_edge.profile import Profile
from posecast_edge.publisher_zenoh import ZenohPublisher
from posecast_edge.schema_build import profile_of
from posecast_edge.settings import Settings
from posecast_edge.sources import Sample, Source, SourceError
from posecast_edge.stream import Stream

log = logging.getLogger("posecast_edge")

VIEW = "public"
NAP_S = 0.1  # the longest sleep: a signal is noticed this soon
STOP_S = 0.7


class Agent:
    """Runs until the source ends, fails, or `stop` is called."""

    def __init__(
        self,
        settings: Settings,
        source: Source,
        profile: Profile | None,
        bundle: Bundle | None,
        console: Console,
    ) -> None:
        """posecast_wire.SchemaError when the wire cannot carry the profile."""
        self._settings = settings
        self._source = source
        self._console = console
        self._model = bundle.hash if bundle else None
        self._useless = Complaints(log.warning, "useless samples")
        self._stream = self._new_stream(profile) if profile else None
        self._publisher = ZenohPublisher(
            settings.robot,
            VIEW,
            settings.relay,
            snapshot=self._snapshot,
            heard=self._force_key,
            bundle=bundle,
        )
        self._rate = RateControl(settings.hz)
        self._meter = Meter()
        self._stopping = False
        self._source_stop = threading.Event()
        self._source_ended = False
        self._failure: str | None = None
        self.link_closed = False  # after `run`: the link's thread has ended too

    def stop(self) -> None:
        """End soon. Safe inside a signal handler: it takes no lock."""
        self._stopping = True

    def run(self) -> int:
        """Exit status: 0 when told to end or the source ended, 1 when the source failed."""
        self._publisher.start()
        threading.Thread(target=self._read_source, name="source", daemon=True).start()
        echoes = 0
        next_s = time.monotonic()
        while not self._stopping and not self._source_ended:
            now_s = time.monotonic()
            if now_s < next_s:
                time.sleep(min(next_s - now_s, NAP_S))
                continue
            if self._publisher.echoes != echoes:
                echoes = self._publisher.echoes
                self._rate.note(self._publisher.late_s, now_s)
            next_s = max(next_s + 1 / self._rate.hz, now_s)  # never catch up: a late frame is an old pose
            self._tick(now_s)
        self._source_stop.set()
        if self._source_ended:
            self._tick(time.monotonic())  # the last sample
            log.log(logging.ERROR if self._failure else logging.INFO, "%s", self._failure or "source ended")
        self.link_closed = self._publisher.stop(STOP_S)
        self._console.finish()
        return 1 if self._failure else 0

    # --- the clock's thread

    def _tick(self, now_s: float) -> None:
        stream = self._stream
        if stream is not None:
            self._tell(stream.idle(now_s))
            # without a link nothing is encoded: the newest sample waits, and only the newest
            frame = stream.tick(now_s) if self._publisher.connected else None
            if frame is not None:
                self._publisher.frame(frame.data, frame.seq)
                self._meter.frame(len(frame.data))
        if self._console.due(now_s):
            self._console.progress(self._progress(now_s), now_s)

    def _tell(self, events: list[Event]) -> None:
        for event in events:
            self._publisher.event(event)

    def _progress(self, now_s: float) -> str:
        link = self._publisher.word()
        if link == "late":
            link = f"late {self._publisher.late_s:.1f} s, asked for {self._rate.hz:g} Hz"
        stream = self._stream
        source = "no sample yet" if stream is None or not stream.started else "live"
        if stream is not None and stream.silent:
            source = "silent"
        flow = self._meter.take(now_s)
        return f"{self._settings.robot} | {link} | {flow} | {self._source.description}: {source}"

    # --- the source's thread

    def _read_source(self) -> None:
        try:
            self._source.run(self._deliver, self._source_stop)
        except SourceError as e:
            self._failure = f"source: {e}"
        except Exception as e:  # a source is the part others write: its bug must not look like a silent robot
            log.debug("source", exc_info=True)
            self._failure = f"source: {type(e).__name__}: {e}"
        self._source_ended = True

    def _deliver(self, sample: Sample) -> None:
        now_s = time.monotonic()
        stream = self._stream
        if stream is None:
            try:
                stream = self._new_stream(profile_of(self._settings.robot, sample))
            except (SourceError, SchemaError) as e:
                self._useless.add(f"{sample.where}: {e}" if sample.where else str(e), now_s)
                return
        info = stream.info
        self._tell(stream.deliver(sample, now_s))
        if stream.info is not info:
            self._publisher.info(stream.info)
        self._stream = stream  # seen by the clock only now, with its first sample in it

    def _new_stream(self, profile: Profile) -> Stream:
        return Stream(profile, self._settings.key_interval_s, log.warning)

    # --- called by the link

    def _snapshot(self) -> Snapshot | None:
        stream = self._stream
        return stream.snapshot(self._model) if stream else None

    def _force_key(self) -> None:
        stream = self._stream
        if stream:
            stream.force_key()


class Meter:
    """Frames and bytes since it was last read."""

    def __init__(self) -> None:
        self._since_s: float | None = None
        self._frames = 0
        self._bytes = 0

    def frame(self, size: int) -> None:
        """A frame of `size` bytes went out."""
        self._frames += 1
        self._bytes += size

    def take(self, now_s: float) -> str:
        """Rate and mean size since the last call (monotonic seconds)."""
        passed_s = now_s - self._since_s if self._since_s is not None else 0.0
        frames, total = self._frames, self._bytes
        self._since_s, self._frames, self._bytes = now_s, 0, 0
        rate = frames / passed_s if passed_s > 0 else 0.0
        return f"{rate:.1f} Hz, {total / frames:.0f} B/frame" if frames else "0 Hz"
