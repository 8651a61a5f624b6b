"""The link against a real router: what arrives, what is answered, what happens when it breaks."""

from __future__ import annotations

import hashlib
import json
import signal
import threading
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import pytest
import zenoh
from edge_stage import ROBOT, Edge, Feeder, Got, Router
from posecast_edge.uplink import publisher
from posecast_edge.uplink.publisher import ZenohPublisher
from posecast_edge.uplink.route import RelayRoute
from posecast_testing import until
from posecast_wire.decoder import Decoder
from posecast_wire.keys import Echo, Snapshot, Stamp, alive_key, event_key, frame_key, model_key, snapshot_key

Start = Callable[..., Edge]


@pytest.fixture
def fed(edge: Start, profile_file: Path) -> Iterator[tuple[Edge, Feeder]]:
    e = edge("--profile", str(profile_file), "--hz", "30", "--key-interval", "30")
    feeder = Feeder(e)
    yield e, feeder
    feeder.stop()


def test_frames_arrive_with_stamps_and_decode(router: Router, fed: tuple[Edge, Feeder]) -> None:
    until("30 frames", lambda: len(router.frames) >= 30)
    frames = list(router.frames)
    assert {f.key for f in frames} == {frame_key(ROBOT, "public")}
    assert len({f.stamp.run_id for f in frames}) == 1
    elapsed = [f.stamp.elapsed_ns for f in frames]
    assert all(a < b for a, b in pairwise(elapsed))
    assert frames[0].header.is_key
    sample = router.snapshot()
    assert sample is not None
    assert sample.attachment is not None
    assert Stamp.unpack(sample.attachment.to_bytes()).run_id == frames[0].stamp.run_id
    decoder = Decoder()
    decoder.add_schema(Snapshot.unpack(sample.payload.to_bytes()).schema)
    decoded = [decoder.decode(f.data) for f in frames]
    assert [d.seq for d in decoded] == list(range(decoded[0].seq, decoded[0].seq + len(decoded)))
    assert decoded[-1].values("pos")[1] is None
    assert decoded[-1].values("pos")[0] == pytest.approx(decoded[-1].values("ref")[0])


def test_snapshot_holds_what_a_late_joiner_needs(router: Router, fed: tuple[Edge, Feeder]) -> None:
    _, feeder = fed
    feeder.extra = {"info": {"mode": "walking"}}
    until("frames", lambda: len(router.frames) >= 20)
    sample = router.snapshot()
    assert sample is not None
    snapshot = Snapshot.unpack(sample.payload.to_bytes())
    assert snapshot.info == {"mode": "walking"}
    assert snapshot.model is None
    decoder = Decoder()
    schema = decoder.add_schema(snapshot.schema)
    assert schema.robot == "two-joints"
    decoder.decode(snapshot.key)
    n = len(router.frames)
    until("a newer frame", lambda: len(router.frames) > n)
    decoder.decode(router.frames[-1].data)  # the base in the snapshot is the one frames name


def test_alive_token_comes_and_goes(router: Router, fed: tuple[Edge, Feeder]) -> None:
    until("token", lambda: router.tokens == [(alive_key(ROBOT), True)])
    fed[0].process.kill()
    until("token lost", lambda: router.tokens[1:] == [(alive_key(ROBOT), False)])


def test_restarted_relay_gets_a_key_at_once_and_no_backlog(router: Router, fed: tuple[Edge, Feeder]) -> None:
    until("frames", lambda: len(router.frames) >= 10)
    router.stop()
    down_at_t = fed[1].t
    until("a second of samples without a link", lambda: fed[1].t > down_at_t + 1.0)
    router.frames.clear()
    up_s = time.monotonic()
    router.start()

    def fresh() -> list[Got]:
        return [f for f in router.frames if f.at_s >= up_s]  # one from before may have been on its way

    until("frames again", lambda: len(fresh()) >= 10)
    first = fresh()[0]
    assert first.header.is_key  # though keys are 30 s apart
    assert first.header.t > down_at_t + 0.9  # the newest state, not what happened meanwhile
    assert sum(f.header.is_key for f in fresh()[:10]) == 1
    # nothing of what waited: each is younger than the one before, and none lies between two
    assert all(a.stamp.elapsed_ns < b.stamp.elapsed_ns for a, b in pairwise(fresh()[:10]))
    decoder = router.decoder()
    assert decoder is not None
    seqs = [decoder.decode(f.data).seq for f in fresh()[:10]]
    assert seqs == list(range(seqs[0], seqs[0] + 10))


def test_relay_that_comes_later_gets_a_key_first(edge: Start, profile_file: Path, router: Router) -> None:
    router.stop()
    e = edge("--profile", str(profile_file), "--key-interval", "30")
    feeder = Feeder(e)
    until("a line that says so", lambda: any("does not answer" in line for line in e.lines))
    router.start()
    until("frames", lambda: len(router.frames) >= 3)
    assert router.frames[0].header.is_key
    feeder.stop()


def test_unchanged_robot_is_confirmed_only_while_the_source_delivers(
    router: Router, fed: tuple[Edge, Feeder]
) -> None:
    _, feeder = fed
    until("frames", lambda: len(router.frames) >= 5)
    feeder.moving = False
    still_since_s = time.monotonic() + 0.5

    def still() -> list[float]:
        return [f.stamp.elapsed_ns / 1e9 for f in router.frames if f.at_s > still_since_s]

    until("five confirmations", lambda: len(still()) >= 5)
    feeder.stop()
    silent = {"level": "caution", "source": "source", "text": "silent", "state": "on"}
    until("source silent", lambda: bool(router.events) and silent.items() <= router.events[-1].items())
    assert all(a < b for a, b in pairwise(still())), "each is of a sample of its own"


def test_a_fault_of_30_ms_becomes_two_events(router: Router, edge: Start, profile_file: Path) -> None:
    e = edge("--profile", str(profile_file), "--hz", "1")  # one frame a second can't see it
    e.send(t=0.0, flags=[0, 0])
    until("first frame", lambda: len(router.frames) >= 1)
    for i in range(200):  # a second at 200 Hz, faulty for 30 ms
        e.send(t=i / 200, flags={"RKN": ["homed", "jam"] if 100 <= i < 106 else ["homed"], "LKN": []})
    until("two events", lambda: len(router.events) >= 2)
    assert router.events == [
        {"type": "event", "t": 0.5, "level": "fault", "source": "RKN", "text": "jam", "state": "on"},
        {"type": "event", "t": 0.53, "level": "fault", "source": "RKN", "text": "jam", "state": "off"},
    ]


def test_changed_info_is_sent_at_once(router: Router, fed: tuple[Edge, Feeder]) -> None:
    _, feeder = fed
    until("first frame", lambda: len(router.frames) >= 1)
    feeder.extra = {"info": {"mode": "walking"}}
    until("the info", lambda: {"type": "info", "kv": {"mode": "walking"}} in router.events)
    feeder.extra = {"info": {"mode": "standing"}}
    until("the new info", lambda: {"type": "info", "kv": {"mode": "standing"}} in router.events)
    assert len(router.events) == 2


def test_model_ranges_hash_right(router: Router, edge: Start, tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    mesh = bytes(i * 7 % 251 for i in range(600_000))
    (tmp_path / "meshes" / "a.stl").write_bytes(mesh)
    (tmp_path / "r.urdf").write_text(
        '<robot name="r"><link name="l"><visual><geometry><mesh filename="meshes/a.stl"/></geometry></visual>'
        '<visual><geometry><mesh filename="package://x/gone.stl"/></geometry></visual></link></robot>'
    )
    e = edge("--urdf", str(tmp_path / "r.urdf"), mesh_tools=False)
    e.send(pos={"RKN": 0.1})
    until("snapshot", lambda: router.snapshot() is not None)
    sample = router.snapshot()
    assert sample is not None
    model = Snapshot.unpack(sample.payload.to_bytes()).model
    [reply] = router.get(model_key(ROBOT, "manifest"))
    assert reply.ok is not None
    manifest_bytes = reply.ok.payload.to_bytes()
    assert hashlib.sha256(manifest_bytes).hexdigest() == model
    manifest = json.loads(manifest_bytes)
    assert manifest["missing"] == ["package://x/gone.stl"]
    assert any("1 of 3 files missing: package://x/gone.stl" in line for line in e.lines)
    entry = next(f for f in manifest["files"] if f["uri"] == "meshes/a.stl")
    got = b""
    while len(got) < entry["size"]:
        part = model_key(ROBOT, entry["sha256"])
        [reply] = router.get(f"{part}?off={len(got)};len=250000")
        assert reply.ok is not None
        assert str(reply.ok.key_expr) == part
        data = reply.ok.payload.to_bytes()
        assert 0 < len(data) <= 250_000
        got += data
    assert hashlib.sha256(got).hexdigest() == entry["sha256"]
    assert got == mesh
    for bad in (f"{part}?off=0;len=250001", f"{part}?off=-1", f"{part}?off=x", model_key(ROBOT, "0" * 64)):
        [reply] = router.get(bad)
        assert reply.ok is None
        assert reply.err is not None


def test_nothing_flows_towards_the_robot(router: Router, fed: tuple[Edge, Feeder]) -> None:
    until("frames", lambda: len(router.frames) >= 5)
    assert router.session is not None
    declared = [str(r.ok.key_expr) for r in router.get("@/*/router/**") if r.ok is not None]
    sources = {
        str(r.ok.key_expr): r.ok.payload.to_string()
        for r in router.get("@/*/router/subscriber/**")
        if r.ok is not None
    }
    assert any("/queryable/" in key for key in declared)  # the admin space does tell
    own = str(router.session.zid())
    for text in sources.values():  # every subscriber is this test's own
        peers = [zid for kind in json.loads(text).values() for zid in kind]
        assert set(peers) <= {own}, sources
    before = router.snapshot()
    assert before is not None
    for key in (frame_key(ROBOT, "public"), snapshot_key(ROBOT, "public"), event_key(ROBOT, "public")):
        router.session.put(key, b"evil")
    router.session.put(model_key(ROBOT, "manifest"), b"evil")
    router.session.delete(snapshot_key(ROBOT, "public"))
    n = len(router.frames)
    until("frames go on", lambda: len([f for f in router.frames[n:] if f.data != b"evil"]) >= 5)
    after = router.snapshot()
    assert after is not None
    assert (
        Snapshot.unpack(after.payload.to_bytes()).schema == Snapshot.unpack(before.payload.to_bytes()).schema
    )


def test_progress_follows_the_echo(router: Router, fed: tuple[Edge, Feeder]) -> None:
    edge, _ = fed
    router.echo = lambda: (
        Echo(router.frames[-1].stamp.run_id, router.frames[-1].header.seq, 0.0) if router.frames else None
    )
    until("on air", lambda: any("on air" in line for line in edge.lines), 15.0)
    line = next(line for line in edge.lines if "on air" in line)
    assert line.startswith("r1 | on air | ")
    assert "B/frame" in line
    router.echo = lambda: Echo(12345, 7, 0.0)
    until("refused", lambda: any("refused" in line for line in edge.lines), 15.0)


def test_late_frames_halve_the_rate(router: Router, fed: tuple[Edge, Feeder]) -> None:
    until("frames", lambda: len(router.frames) >= 5)
    run_id = router.frames[0].stamp.run_id
    router.echo = lambda: Echo(run_id, 0, 0.0)  # as if nothing newer than the first frame ever came through

    def rate() -> float:
        recent = [f.at_s for f in router.frames if f.at_s > time.monotonic() - 1.0]
        return (len(recent) - 1) / (recent[-1] - recent[0]) if len(recent) > 1 else 0.0

    until("half the rate", lambda: 0 < rate() < 20, 10.0)
    router.echo = lambda: Echo(run_id, router.frames[-1].header.seq, 0.0)
    until("30 Hz", lambda: any("frames arrive in time: 30 Hz again" in line for line in fed[0].lines), 30.0)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_it_quickly(number: int, router: Router, fed: tuple[Edge, Feeder]) -> None:
    edge, _ = fed
    until("frames", lambda: len(router.frames) >= 5)
    edge.process.send_signal(number)
    assert edge.wait() == 0
    until("token withdrawn", lambda: router.tokens[-1:] == [(alive_key(ROBOT), False)])
    assert not any("Traceback" in line for line in edge.lines)


def test_signal_ends_it_without_a_link(edge: Start) -> None:
    from posecast_testing import free_port

    e = edge(relay=f"tcp/127.0.0.1:{free_port()}")
    until("progress", lambda: any("no link" in line for line in e.lines))
    e.process.send_signal(signal.SIGINT)
    assert e.wait() == 0


def test_end_of_input_sends_the_last_sample_and_ends_with_0(router: Router, edge: Start) -> None:
    e = edge("--hz", "1")
    e.send(t=1.0, pos={"RKN": 0.1})
    until("first frame", lambda: len(router.frames) == 1)
    e.send(t=1.5, pos={"RKN": 0.2})
    e.end_of_input()
    assert e.wait() == 0
    until("last frame", lambda: len(router.frames) == 2)
    assert any("source ended" in line for line in e.lines)


def test_bad_lines_are_named_and_the_rest_keeps_running(
    router: Router, edge: Start, profile_file: Path
) -> None:
    e = edge("--profile", str(profile_file))
    e.send(t=0.0, pos=[0.0, 0.0])
    until("first frame", lambda: len(router.frames) == 1)
    e.send_text('{"t": 0.1, "pos": [1, }')
    e.send(t=0.2, pos=[0.0, 0.0, 0.0])
    e.send(t=0.3, pos={"RKM": 1.0})
    e.send_text('{"t": 0.4, "pos": [NaN, Infinity]}')
    e.send(t=0.5, pos=[0.25, 0.5])
    until("line 2", lambda: any("line 2: not JSON" in line for line in e.lines))
    until("line 3", lambda: any("line 3: pos has 3 values, 2 expected" in line for line in e.lines))
    until("line 4", lambda: any("line 4: unknown label of pos 'RKM'" in line for line in e.lines))
    decoder = router.decoder()
    assert decoder is not None
    until("line 6", lambda: [decoder.decode(f.data) for f in router.frames][-1].values("pos") == [0.25, 0.5])
    assert e.process.poll() is None


# --- the publisher's threads inside this process: which of them uses the session while another closes it

LOOK_S = 0.3  # so long a question goes on after the end


def test_a_session_is_closed_only_when_no_question_is_asked_over_it(
    router: Router, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(publisher, "ECHO_END_S", 20.0)
    asks, closed = threading.Event(), list[bool]()

    def ask_until_it_ends(self: ZenohPublisher, session: zenoh.Session) -> None:
        asks.set()
        until("the end", lambda: self._stopping, 20.0)
        until_s = time.monotonic() + LOOK_S
        while not session.is_closed() and time.monotonic() < until_s:
            time.sleep(0.01)
        closed.append(session.is_closed())

    monkeypatch.setattr(ZenohPublisher, "_echo_of", ask_until_it_ends)
    route = RelayRoute(router.endpoint)
    link = ZenohPublisher(ROBOT, ["public"], route, snapshot=lambda _: None, heard=lambda _: None)
    link.start()
    until("it asks", asks.is_set)
    link.stop(20.0)
    link.wait_for_end(20.0)
    assert closed == [False]


def test_the_end_waits_for_the_threads_of_callbacks(router: Router, monkeypatch: pytest.MonkeyPatch) -> None:
    """A callback that returns from Zenoh into an interpreter that ends would abort the process."""
    is_called, may_return = threading.Event(), threading.Event()

    def hold(self: ZenohPublisher, session: zenoh.Session, event: zenoh.TransportEvent) -> None:
        del session
        self.connected = event.kind == zenoh.SampleKind.PUT
        if not self.connected:
            is_called.set()
            may_return.wait(20.0)

    monkeypatch.setattr(ZenohPublisher, "_on_transport", hold)
    route = RelayRoute(router.endpoint)
    link = ZenohPublisher(ROBOT, ["public"], route, snapshot=lambda _: None, heard=lambda _: None)
    before = set(threading.enumerate())
    link.start()
    until("a link", lambda: link.connected)
    ours = set(threading.enumerate()) - before
    router.stop()
    until("the end of the link is told", is_called.is_set)
    link.stop(20.0)
    waiting = threading.Thread(target=link.wait_for_end, args=(20.0,))
    waiting.start()
    waiting.join(LOOK_S)
    assert waiting.is_alive()
    may_return.set()
    waiting.join(20.0)
    assert [t.name for t in ours if t.is_alive()] == []
