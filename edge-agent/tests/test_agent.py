"""Where a mistake ends: one raises in every call of the agent, and the others go on."""

from __future__ import annotations

import io
import logging
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from edge_stage import PROFILE, ROBOT, Got, Router
from posecast_edge import kit
from posecast_edge.agent import Agent, AgentSettings
from posecast_edge.cli.console import Console
from posecast_edge.model.serve.bundle import Bundle
from posecast_edge.pipeline.events import Event
from posecast_edge.pipeline.stream import Frame
from posecast_edge.pipeline.view_pipeline import ViewPipeline
from posecast_edge.profile.reader import parse_profile
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.base import Deliver
from posecast_edge.uplink.route import RelayRoute
from posecast_testing import until
from posecast_wire.decoder import Decoder
from posecast_wire.frame import parse_header
from posecast_wire.keys import frame_key, snapshot_key

VIEWS = """
[views.public]
[views.lab]
"""


class Moving:
    """A source of 100 samples a second, with a knee that moves and a fault that comes and goes. Before each
    it raises what stands in `errors`."""

    description = "test"

    def __init__(self) -> None:
        self.errors: list[BaseException] = []
        self.turns = 0
        self.info: dict[str, str] = {}

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        self.turns += 1
        while not stop.wait(0.01):
            if self.errors:
                raise self.errors.pop(0)
            t_s = kit.now_s()
            deliver(Sample(t_s, {"pos": [t_s % 3, None], "flags": [2 * (t_s % 0.4 > 0.2), 0]}, self.info))


class Running:
    """An agent of two views in this process, and what it has said."""

    def __init__(self, router: Router) -> None:
        self.source = Moving()
        self.said = io.StringIO()
        settings = AgentSettings(ROBOT, RelayRoute(router.endpoint), 30.0, 30.0)
        self.console = Console(self.said)
        logging.getLogger("posecast_edge").addHandler(self.console)
        logging.getLogger("posecast_edge").setLevel(logging.INFO)
        self.agent = Agent(settings, self.source, parse_profile(PROFILE + VIEWS), self.console)
        self._router = router
        self._thread = threading.Thread(target=self.agent.run)
        self._thread.start()

    def pipeline(self, view: str) -> ViewPipeline:
        return next(pipeline for pipeline in self.agent._pipelines if pipeline.view == view)

    def frames(self, view: str) -> list[Got]:
        key = frame_key(ROBOT, view)
        return [f for f in list(self._router.frames) if f.key == key]

    def goes_on(self, view: str, frames: int = 10) -> None:
        n = len(self.frames(view))
        until(f"{view} goes on", lambda: len(self.frames(view)) >= n + frames)

    def end(self) -> None:
        self.agent.stop()
        self._thread.join()
        logging.getLogger("posecast_edge").removeHandler(self.console)


@pytest.fixture
def running(router: Router) -> Iterator[Running]:
    made = Running(router)
    for view in ("public", "lab"):
        made.goes_on(view)
    yield made
    made.end()


def raises(*_: object, **__: object) -> Any:
    raise ValueError("nonsense\nin two lines")


# (what raises, whose it is, whether the view goes without frames meanwhile)
CALLS: list[tuple[str, Callable[[Running], object], bool]] = [
    ("deliver", lambda r: r.pipeline("public").stream, True),
    ("tick", lambda r: r.pipeline("public").stream, True),
    ("check_time", lambda r: r.pipeline("public").stream, False),
    ("make_snapshot", lambda r: r.pipeline("public").stream, False),
    ("encode", lambda r: r.pipeline("public").stream._encoder, True),  # type: ignore[union-attr]
    ("quantise", lambda r: r.pipeline("public").stream._sampler._quantiser, True),  # type: ignore[union-attr]
    ("flatten", lambda r: r.pipeline("public").stream._flattener, True),  # type: ignore[union-attr]
    ("check_sample", lambda r: r.pipeline("public").stream._watch, True),  # type: ignore[union-attr]
    ("admit", lambda r: r.pipeline("public").stream._limit, False),  # type: ignore[union-attr]
    # the clock may find a sample before it is dropped
    ("is_due", lambda r: r.pipeline("public").pacer, False),
    ("record_frame", lambda r: r.pipeline("public").pacer, True),
    ("send_frame", lambda r: r.agent._publisher._view_publishers["public"], True),
    ("send", lambda r: r.agent._publisher._view_publishers["public"], False),
]


@pytest.mark.parametrize(("call", "owner", "without_frames"), CALLS, ids=[call for call, _, _ in CALLS])
def test_what_one_view_raises_ends_there(
    running: Running, router: Router, call: str, owner: Callable[[Running], object], without_frames: bool
) -> None:
    owned = owner(running)
    healthy = getattr(owned, call)
    setattr(owned, call, raises)
    key = snapshot_key(ROBOT, "public")
    if call == "make_snapshot":
        assert [reply.ok for reply in router.get(key)] == []
    if call == "check_time":
        until("a look for silence", lambda: running.agent.exceptions.count("view public") > 0)
    running.goes_on("lab", 30)
    n = len(running.frames("public"))
    running.goes_on("lab", 30)
    if without_frames:
        assert len(running.frames("public")) == n
    assert router.get(snapshot_key(ROBOT, "lab"))[0].ok is not None
    setattr(owned, call, healthy)
    running.goes_on("public", 20)
    assert router.get(key)[0].ok is not None
    if without_frames:
        assert parse_header(running.frames("public")[n].data).is_key, (
            "it begins anew with a frame that stands alone"
        )
    said = running.said.getvalue()
    assert "Traceback" not in said
    assert len(said.splitlines()) < 20, said
    if call != "admit":
        assert "nonsense\\nin two lines" in said


@pytest.mark.parametrize(
    "error",
    [
        ValueError("x\ny"),
        OSError("gone"),
        RecursionError(),
        MemoryError(),
        SystemExit(1),
        AssertionError(),
        UnicodeEncodeError("utf-8", "\ud800", 0, 1, "surrogates"),
    ],
    ids=lambda e: type(e).__name__,
)
def test_what_a_source_raises_ends_its_turn(running: Running, error: BaseException) -> None:
    running.source.errors.append(error)
    until("another turn", lambda: running.source.turns == 2)
    for view in ("public", "lab"):
        running.goes_on(view)
    line = next(line for line in running.said.getvalue().splitlines() if "the source" in line)
    assert line.startswith(f"posecast-edge: the source, which is restarted: {type(error).__name__}: ")


def test_a_source_that_says_it_can_not_go_on_ends_the_agent(running: Running) -> None:
    running.source.errors.append(SourceError("walk.csv: is a directory"))
    until("the end", lambda: "source: walk.csv: is a directory" in running.said.getvalue())


NO_SAMPLES: list[Any] = [
    None,
    5,
    ("a",),
    Sample("x", {}),  # type: ignore[arg-type]
    Sample(0.0, None),  # type: ignore[arg-type]
    Sample(0.0, {"pos": 5}),  # type: ignore[dict-item]
]


@pytest.mark.parametrize("sample", NO_SAMPLES)
def test_no_sample_of_a_source_ends_the_agent(running: Running, sample: Any) -> None:
    raised: list[BaseException] = []
    try:
        running.agent._deliver(sample)
    except Exception as e:
        raised.append(e)  # the source's own
    for view in ("public", "lab"):
        running.goes_on(view)


def test_viewers_are_told_a_source_s_trouble(running: Running, router: Router) -> None:
    told = {"level": "fault", "source": "source", "text": "robot's samples are too large"}

    def heard(on: bool) -> bool:
        wanted = {**told, "state": "on" if on else "off"}
        return any(event.items() >= wanted.items() for event in router.events)

    running.source.trouble = told["text"]  # type: ignore[attr-defined]
    until("the trouble", lambda: heard(True))
    running.source.trouble = ""  # type: ignore[attr-defined]
    until("its end", lambda: heard(False))


def test_half_a_character_ends_nothing(running: Running, router: Router) -> None:
    running.source.info = {"mode": "walks", "bad": "\ud800", "\udfff": "bad"}
    until("what is text of it", lambda: {"type": "info", "kv": {"mode": "walks"}} in router.events)
    for view in ("public", "lab"):
        running.goes_on(view)
    assert (
        "info 'bad' is left out: it is not valid Unicode (half of a surrogate pair)"
        in running.said.getvalue()
    )


class Wire:
    """In the publisher's place: what leaves, while somebody listens."""

    def __init__(self) -> None:
        self.may_send = True
        self.frames: list[Frame] = []
        self.blocks: Callable[[], None] = lambda: None

    def send_frame(self, _view: str, frame: Frame) -> None:
        self.frames.append(frame)
        self.blocks()

    def queue_event(self, _view: str, event: Event) -> None:
        pass


class Still:
    """An agent that nothing but the test drives, on the test's clock. The robot's runs 1000 s ahead of it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 50.0
        monkeypatch.setattr(kit, "now_s", lambda: self.now_s)
        settings = AgentSettings(ROBOT, RelayRoute("tcp/127.0.0.1:1"), 30.0, 30.0)
        self.agent = Agent(settings, Moving(), parse_profile(PROFILE), Console(io.StringIO()))
        self.wire = Wire()
        self.agent._publisher = self.wire  # type: ignore[assignment]
        self.pipeline = self.agent._pipelines[0]

    def sample(self, sent_s: float | None = None) -> None:
        """One arrives that the robot sent at `sent_s`, by our clock; just now, if not given."""
        t_s = (self.now_s if sent_s is None else sent_s) + 1000.0
        self.agent._deliver(Sample(t_s, {"pos": [t_s, None]}))

    def samples(self, seconds: float) -> None:
        for _ in range(round(seconds * 30)):
            self.now_s += 1 / 30
            self.sample()

    def look(self) -> None:
        """What the clock's thread does when a frame is due."""
        if self.pipeline.compute_rest_s(self.now_s) == 0:
            self.agent._send(self.pipeline)


def test_every_frame_is_stamped_with_its_samples_arrival(monkeypatch: pytest.MonkeyPatch) -> None:
    still = Still(monkeypatch)
    still.samples(1.0)
    assert len(still.wire.frames) == 30
    assert still.wire.frames[-1].taken_s == still.now_s
    still.now_s += 0.01
    still.sample()  # too early for its pace: it waits
    taken_s = still.now_s
    still.now_s += 0.08
    still.look()
    assert len(still.wire.frames) == 31
    assert still.wire.frames[-1].taken_s == taken_s


def test_the_stamp_on_the_wire_is_when_the_sample_was_taken(running: Running) -> None:
    publisher = running.agent._publisher
    taken_s = kit.now_s() + 1000.0
    publisher.send_frame("lab", Frame(running.frames("lab")[0].data, 0, taken_s))
    stamp = publisher.run.make_stamp(taken_s)
    until("the stamp", lambda: stamp in [f.stamp for f in running.frames("lab")])


def test_a_sample_from_before_an_outage_is_a_picture_and_no_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    still = Still(monkeypatch)
    still.samples(1.0)
    still.wire.may_send = False
    still.samples(1.0)
    before = len(still.wire.frames)
    still.now_s += 10.0  # the source falls silent, then the link comes back
    still.wire.may_send = True
    still.agent._force_key("public")
    for _ in range(30):
        still.look()
        still.now_s += 0.1
    assert len(still.wire.frames) == before
    pictured = still.agent._snapshot("public")
    assert pictured is not None
    decoder = Decoder()
    decoder.add_schema(pictured.schema)
    assert decoder.decode(pictured.key).t_s == pytest.approx(1052.0)
    still.sample()
    frame = still.wire.frames[-1]
    assert (len(still.wire.frames), frame.taken_s) == (before + 1, still.now_s)
    assert parse_header(frame.data).is_key


def test_a_put_that_blocks_holds_up_and_what_waited_meanwhile_is_old(monkeypatch: pytest.MonkeyPatch) -> None:
    still = Still(monkeypatch)
    still.samples(1.0)

    def block() -> None:
        still.now_s += 5.0
        still.wire.blocks = lambda: None

    still.wire.blocks = block
    still.samples(1 / 30)  # the source's thread is in it for five seconds
    before, blocked_s = len(still.wire.frames), still.now_s - 5.0
    for i in range(1, 140):  # what the source has said meanwhile
        still.now_s += 0.0001
        still.sample(blocked_s + i / 30)
        still.look()
    assert len(still.wire.frames) == before
    still.samples(0.2)
    assert [f.taken_s > blocked_s + 5.0 for f in still.wire.frames[before:]] == [True] * 6


def test_after_standing_still_no_pose_from_before_is_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    """SIGSTOP and SIGCONT: what waited in the source arrives all at once."""
    still = Still(monkeypatch)
    still.samples(1.0)
    still.sample()  # waits for its pace
    before, stopped_s = len(still.wire.frames), still.now_s
    still.now_s += 10.0
    still.look()
    for i in range(299):
        still.now_s += 0.0001
        still.sample(stopped_s + i / 30)
        still.look()
    assert len(still.wire.frames) - before <= 3, "the last tenth of a second"
    still.samples(1.0)
    new = still.wire.frames[before:]
    assert len(new) >= 30
    for frame in new:
        assert frame.taken_s > stopped_s + 10.0
    decoder = Decoder()
    assert still.pipeline.stream is not None
    decoder.add_schema(still.pipeline.stream.schema.text)
    told = [decoder.decode(frame.data).t_s - 1000.0 for frame in still.wire.frames]
    assert told[before] > stopped_s + 9.8


def test_a_model_that_comes_later_changes_units_once(router: Router) -> None:
    class Gripper(Moving):
        def run(self, deliver: Deliver, stop: threading.Event) -> None:
            while not stop.wait(0.01):
                t_s = kit.now_s()
                deliver(Sample(t_s, {"pos": {"arm": t_s % 3, "finger": t_s % 0.04}}))

    settings = AgentSettings(ROBOT, RelayRoute(router.endpoint), 30.0, 30.0)
    agent = Agent(settings, Gripper(), None, Console(io.StringIO()))
    thread = threading.Thread(target=agent.run)
    thread.start()

    def schemas() -> list[int]:
        headers = [f.header for f in list(router.frames)]
        return list(dict.fromkeys(header.schema_id for header in headers if header.schema_id is not None))

    try:
        until("frames of a robot without a model", lambda: len(router.frames) >= 10)
        agent.expect_model(Bundle(b"", [], [], frozenset(), [("finger", "prismatic")]))
        until("another schema", lambda: len(schemas()) == 2)
        n = len(router.frames)
        until("it goes on", lambda: len(router.frames) >= n + 10)
    finally:
        agent.stop()
        thread.join()
    assert len(schemas()) == 2
    stream = agent._pipelines[0].stream
    assert stream is not None
    assert stream.schema.id == schemas()[1]
    assert stream.schema.mapping.units == {"pos": {"finger": "m"}}
