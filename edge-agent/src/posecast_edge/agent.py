"""Connects source, clock and uplink, and runs them until the source ends.

An exception in one view costs that view one frame. After an unexpected exception the source is restarted.
Both are logged and counted; everything else continues.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from posecast_wire.credential import Credential
from posecast_wire.keys import Snapshot
from posecast_wire.schema import JOINT

from posecast_edge import kit
from posecast_edge.kit import ExceptionLog, OnceLog, PartLog, make_visible, quote
from posecast_edge.model.finding import quote_names
from posecast_edge.model.serve.bundle import Bundle
from posecast_edge.pipeline.events import Event
from posecast_edge.pipeline.inferred_channels import InferredChannels
from posecast_edge.pipeline.intake import Backlog, TextGuard
from posecast_edge.pipeline.stream import Stream
from posecast_edge.pipeline.view_pipeline import ViewPipeline
from posecast_edge.profile.schema import POSITIONS
from posecast_edge.profile.types import PUBLIC, Profile, find_unknown_feet
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.base import Source, Troubled
from posecast_edge.sources.published.checks import explain_stillness
from posecast_edge.uplink.credentials import Certificate
from posecast_edge.uplink.lateness import RateControl
from posecast_edge.uplink.publisher import ZenohPublisher
from posecast_edge.uplink.route import RelayRoute

log = logging.getLogger("posecast_edge")

NAP_S = 0.2  # the longest sleep; a signal is noticed within it
STOP_S = 0.7
AGAIN_S = (0.5, 10.0)  # first and longest pause before a source that raised unexpectedly is restarted
NAMED_MAX = 4  # joints without a channel
COMPARE_S = 3.0  # from the newest channels or model until these are compared
WELL_S = 60.0  # a run that lasted this long resets the pause


@dataclass(frozen=True)
class AgentSettings:
    """`robot`: the robot's id; `relay`: how to reach the relay; `hz`: highest frame rate;
    `key_interval_s`: longest time between two KEY frames; `credential`: what proves to the relay that this is
    the robot."""

    robot: str
    relay: RelayRoute
    hz: float
    key_interval_s: float
    credential: Credential | Certificate | None = None


class ProgressLine(Protocol):
    """Where the agent shows its status line. Times are seconds of kit.now_s()."""

    def is_due(self, now_s: float) -> bool:
        """Whether it is time to show a new status text."""

    def show_progress(self, text: str, now_s: float) -> None:
        """Show `text` in place of the previous status line."""

    def finish(self) -> None:
        """End the status line; no further text follows."""


class Agent:
    """Reads one source and sends its frames until the source ends, fails, or `stop` is called."""

    def __init__(
        self,
        settings: AgentSettings,
        source: Source,
        profile: Profile | None,
        progress_line: ProgressLine,
        say_left_out: Callable[[str], None] = log.warning,
    ) -> None:
        """`say_left_out` is called with a line for each name that can't become a channel, only without a
        profile; and with a line if no channel moves the model. Raises posecast_wire.SchemaError when the wire
        format can't carry the profile."""
        self._settings = settings
        self._source = source
        self._progress_line = progress_line
        self._profile = profile  # the given one, or the one inferred last
        # a given profile is a choice of what leaves the machine, so only without one there are more channels
        self._channels = None if profile else InferredChannels(settings.robot, say_left_out)
        self._model: str | None = None
        self._lacking_feet: dict[str, str] = {}  # as last logged
        self._still = OnceLog(say_left_out)
        self._shown: Bundle | None = None  # the model, which may still be built
        self._compared: tuple[Profile | None, Bundle | None] = (None, None)
        self._compare_s: float | None = None  # when to compare the profile's channels with the model
        self.exceptions = ExceptionLog()
        self._useless = PartLog(log.warning, "useless samples")
        self._guard = TextGuard(log.warning)
        self._backlog = Backlog()
        self._pipelines = self._pipelines_of(profile)
        self._publisher = ZenohPublisher(
            settings.robot,
            [pipeline.view for pipeline in self._pipelines],
            settings.relay,
            snapshot=self._snapshot,
            heard=self._force_key,
            credential=settings.credential,
        )
        self._bell = threading.Event()  # set when a viewer starts to listen
        self._rate = RateControl(settings.hz)
        self._meter = Meter()
        self._stopping = False
        self._source_stop = threading.Event()
        self._source_ended = False
        self._reported_trouble = False  # trouble before the first sample has been reported
        self._failure: str | None = None

    def set_model(self, bundle: Bundle) -> None:
        """Serve this model from now on. May be called from any thread, also before `run`."""
        self._model = bundle.hash
        self.expect_model(bundle)
        self._publisher.set_model(bundle)

    def expect_model(self, bundle: Bundle) -> None:
        """Take the joints and links of a model that is still being built. Without a profile, they set the
        units of sliding joints: m, m/s and N. With one, logs a line that names feet missing from the model.
        May be called from any thread, also before `run`."""
        self._shown = bundle
        if self._channels is not None:
            self._channels.sliding = bundle.sliding
        lacking = {} if self._profile is None else find_unknown_feet(self._profile.mapping, bundle.links)
        if lacking and lacking != self._lacking_feet:
            named = (
                quote(foot) + ("" if foot == link else f" (on link {quote(link)})")
                for foot, link in lacking.items()
            )
            log.warning("profile: [balance] names feet that are not in the model: %s", ", ".join(named))
        self._lacking_feet = lacking

    def stop(self) -> None:
        """Ask `run` to return soon. Takes no lock, so it is safe inside a signal handler."""
        self._stopping = True

    @property
    def frames(self) -> int:
        """How many frames have been sent, in all views together."""
        return self._meter.total

    def describe_link(self) -> str:
        """The state of the link in a word or two, with the reason when there is none."""
        why = self._publisher.why_no_link
        return f"{self._publisher.describe_state()}: {why}" if why else self._publisher.describe_state()

    def wait_for_link_end(self, timeout_s: float) -> None:
        """After `run`: wait until all threads of the link have ended, at most `timeout_s` seconds."""
        self._publisher.wait_for_end(timeout_s)

    def run(self) -> int:
        """Run until the source ends or `stop` is called. Returns the exit status: 0, or 1 when the source
        failed."""
        self._publisher.start()
        threading.Thread(target=self._read_source, name="source", daemon=True).start()
        echoes = 0
        while not self._stopping and not self._source_ended:
            now_s = kit.now_s()
            if self._publisher.echoes != echoes:
                echoes = self._publisher.echoes
                self._adapt(now_s)
            for pipeline in self._pipelines:
                if pipeline.compute_rest_s(now_s) == 0:
                    self._send(pipeline)
            self._chores(now_s)
            if self._bell.wait(min(NAP_S, *(pipeline.compute_rest_s(now_s) for pipeline in self._pipelines))):
                self._bell.clear()
        self._source_stop.set()
        if self._source_ended:
            for pipeline in self._pipelines:
                self._send(pipeline)  # the last sample
            log.log(logging.ERROR if self._failure else logging.INFO, "%s", self._failure or "source ended")
        self._compare_names(math.inf)
        for pipeline in self._pipelines:
            pipeline.end()  # before the link closes: the source may still deliver samples
        self._publisher.stop(STOP_S)
        self._progress_line.finish()
        return 1 if self._failure else 0

    # --- the clock's thread

    def _adapt(self, now_s: float) -> None:
        before_hz, late_s = self._rate.hz, self._publisher.late_s
        self._rate.record_lateness(late_s, now_s)
        if self._rate.hz < before_hz:
            log.warning("frames arrive %.1f s late: %g Hz instead of %g", late_s, self._rate.hz, before_hz)
        elif self._rate.hz > before_hz:
            log.info("frames arrive in time: %g Hz again", self._rate.hz)
        for line in self._publisher.list_changes():
            log.warning("%s", make_visible(line))

    def _chores(self, now_s: float) -> None:
        for pipeline in self._pipelines:
            self._look_for_silence(pipeline, now_s)
        self._compare_names(now_s)
        if self._progress_line.is_due(now_s):
            self._progress_line.show_progress(self._progress(now_s), now_s)

    def _compare_names(self, now_s: float) -> None:
        """Say which joints of the model get no reading, once these and the channels have been known for a
        while: channels may come one after the other."""
        profile, shown, stream = self._profile, self._shown, self._pipelines[0].stream
        if profile is None or shown is None or stream is None or not stream.started:
            return
        if (profile, shown) != self._compared:
            self._compared, self._compare_s = (profile, shown), now_s + COMPARE_S
        if self._compare_s is None or now_s < self._compare_s:
            return
        self._compare_s = None
        fields = [f for name in POSITIONS if (f := profile.find_field(name)) and f.label_set == JOINT]
        labels = dict.fromkeys(label for f in fields for label in f.labels) | dict.fromkeys(
            profile.mapping.joints
        )
        joints = [joint.name for joint in shown.joints]
        if text := explain_stillness(labels.keys(), shown.readings, joints):
            self._still.add(text, text)
        elif still := [name for name in joints if name not in labels] if labels else []:
            log.info("model: no channel for %s: at rest", quote_names(still, NAMED_MAX))

    def _look_for_silence(self, pipeline: ViewPipeline, now_s: float) -> None:
        try:
            trouble = self._source.trouble if isinstance(self._source, Troubled) else ""
            if pipeline.stream is not None:
                self._send_events(pipeline, pipeline.stream.check_time(now_s, trouble))
            elif trouble and not self._reported_trouble:
                self._reported_trouble = True
                self._send_events(pipeline, [Event(0.0, "fault", "source", trouble, True)])
        except Exception as e:
            self._failed(pipeline, e)

    def _send_events(self, pipeline: ViewPipeline, events: list[Event]) -> None:
        for event in events:
            self._publisher.queue_event(pipeline.view, event)

    def _progress(self, now_s: float) -> str:
        link = self._publisher.describe_state()
        if link == "late":
            link = f"late {self._publisher.late_s:.1f} s, reduced to {self._rate.hz:g} Hz"
        if self._publisher.over:
            link += ", over its limit"
        stream = self._pipelines[0].stream
        source = "no sample yet" if stream is None or not stream.started else "live"
        if stream is not None and stream.silent:
            source = "silent"
        flow = self._meter.take_summary(now_s)
        return f"{self._settings.robot} | {link} | {flow} | {self._source.description}: {source}"

    # --- the source's thread, which also sends: no other thread has to wake up for a frame

    def _send(self, pipeline: ViewPipeline) -> None:
        """Send the frame that is due. The clock's thread calls this when no sample arrived in time."""
        try:
            with pipeline.lock:
                now_s = kit.now_s()
                if pipeline.ended:
                    return
                pipeline.record_frame(now_s, self._rate.hz)
                # don't encode while the link is down or has a queue: only the newest sample is kept, for
                # a short time
                if pipeline.stream is None or not self._publisher.may_send:
                    return
                frame = pipeline.stream.tick(now_s, pipeline.compute_oldest_s(now_s))
                if frame is not None:
                    self._publisher.send_frame(pipeline.view, frame)
                    self._meter.count_frame(len(frame.data))
        except Exception as e:
            self._failed(pipeline, e)

    def _failed(self, pipeline: ViewPipeline, error: Exception) -> None:
        """Drop the view's current frame and continue with the next sample."""
        self.exceptions.add(f"view {pipeline.view}", error)
        if pipeline.stream is not None:
            pipeline.stream.recover()

    def _read_source(self) -> None:
        pause_s = AGAIN_S[0]
        while not self._source_stop.is_set():
            began_s = time.monotonic()
            try:
                self._source.run(self._deliver, self._source_stop)
                break
            except SourceError as e:
                self._failure = f"source: {e}"
                break
            # sources may be third-party code: a bug in one must not silence the robot or end the agent
            except BaseException as e:
                self.exceptions.add("the source, which is restarted", e)
            if time.monotonic() - began_s > WELL_S:
                pause_s = AGAIN_S[0]
            self._source_stop.wait(pause_s)
            pause_s = min(2 * pause_s, AGAIN_S[1])
        self._source_ended = True
        self._bell.set()

    def _deliver(self, sample: Sample) -> float | None:
        now_s = kit.now_s()
        sample = self._guard.clean(sample)
        if self._backlog.is_old(sample.t_s, now_s):
            sample = sample._replace(newest=False)
        wanted_s = math.inf
        for pipeline in self._pipelines:
            try:
                self._deliver_to(pipeline, sample, now_s)
            except Exception as e:
                self._failed(pipeline, e)
            if pipeline.stream is None:
                return None
            wanted_s = min(wanted_s, pipeline.pacer.from_s)
        return wanted_s - kit.now_s() + time.monotonic()  # sources use time.monotonic()

    def _deliver_to(self, pipeline: ViewPipeline, sample: Sample, now_s: float) -> None:
        stream = pipeline.stream
        if self._channels is not None:
            sample = self._channels.take(sample, now_s)
            profile = self._channels.profile
            if profile is None:
                where = f"{sample.where}: " if sample.where else ""
                self._useless.add("", f"{where}no field with named values")
                return
            if stream is None:
                stream = self._new_stream(profile)
            elif profile is not self._profile:
                with pipeline.lock:
                    stream.change_profile(profile)
            self._profile = profile
        assert stream is not None
        info = stream.info
        events = stream.deliver(sample, now_s)
        if events:
            self._send_events(pipeline, events)
        if stream.info is not info:
            self._publisher.queue_info(pipeline.view, stream.info)
        pipeline.stream = stream  # visible to the clock's thread only now that it has a sample
        if sample.newest and pipeline.pacer.is_due(now_s):
            self._send(pipeline)

    def _new_stream(self, profile: Profile) -> Stream:
        return Stream(
            profile, self._settings.key_interval_s, log.warning, says_unknown=self._channels is None
        )

    def _pipelines_of(self, profile: Profile | None) -> list[ViewPipeline]:
        """One pipeline per view, fastest first. Without views: one with everything."""
        hz, now_s = self._settings.hz, kit.now_s()
        if profile is None or not profile.views:
            stream = self._new_stream(profile) if profile else None
            return [ViewPipeline(PUBLIC, hz, stream, now_s)]
        pipelines = [
            ViewPipeline(
                name, min(view.hz or hz, hz), self._new_stream(profile.restrict_to_view(view)), now_s
            )
            for name, view in profile.views.items()
        ]
        return sorted(pipelines, key=lambda pipeline: -pipeline.hz)

    # --- called by the link

    def _pipeline_of(self, view: str) -> ViewPipeline:
        return next(pipeline for pipeline in self._pipelines if pipeline.view == view)

    def _snapshot(self, view: str) -> Snapshot | None:
        stream = self._pipeline_of(view).stream
        return stream.make_snapshot(self._model, kit.now_s()) if stream else None

    def _force_key(self, view: str) -> None:
        pipeline = self._pipeline_of(view)
        if pipeline.stream:
            pipeline.stream.force_key()
            pipeline.at_once = True  # a new viewer gets a frame at once, outside of the pace
            self._bell.set()


class Meter:
    """Counts frames and bytes between two readings."""

    def __init__(self) -> None:
        self._since_s: float | None = None
        self._frames = 0
        self._bytes = 0
        self.total = 0  # frames, ever

    def count_frame(self, size: int) -> None:
        """Count one frame of `size` bytes that was sent."""
        self._frames += 1
        self._bytes += size
        self.total += 1

    def take_summary(self, now_s: float) -> str:
        """Return frame rate (Hz) and mean frame size (bytes) since the last call as text; `now_s` is
        monotonic seconds."""
        passed_s = now_s - self._since_s if self._since_s is not None else 0.0
        frames, total = self._frames, self._bytes
        self._since_s, self._frames, self._bytes = now_s, 0, 0
        rate = frames / passed_s if passed_s > 0 else 0.0
        return f"{rate:.1f} Hz, {total / frames:.0f} B/frame" if frames else "0 Hz"
