"""A relay that answers nonsense, or asks without end: the robot's frames go on, in little memory."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import zenoh
from edge_stage import ROBOT, Edge, Feeder, Router
from posecast_edge.uplink.publisher import SNAPSHOTS_AT_ONCE, SNAPSHOTS_S
from posecast_edge.uplink.session import WAITING_MAX
from posecast_testing import until
from posecast_wire.keys import Echo, echo_key, model_key, snapshot_key
from test_model_background import RSS_KB_MAX, memory_kb

Start = Callable[..., Edge]


@pytest.fixture
def edge_on_air(router: Router, edge: Start, profile_file: Path) -> Iterator[Edge]:
    e = edge("--profile", str(profile_file), "--hz", "30", "--key-interval", "600")
    feeder = Feeder(e)
    until("frames", lambda: len(router.frames) >= 10)
    yield e
    feeder.stop()


def goes_on(router: Router, edge: Edge, frames: int = 30) -> None:
    """Frame after frame, none left out."""
    first = len(router.frames)
    until("frames go on", lambda: len(router.frames) >= first + frames, 20.0)
    seqs = [f.header.seq for f in router.frames[first:] if not f.header.is_key]
    assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))
    assert edge.process.poll() is None
    assert not any("Traceback" in line for line in edge.lines)


JUNK = (
    *(b"", b"\xff\xfe", b"[]", b'{"run":5}', b"[" * 4000, b" " * 100_000, b" " * 8_000_000),
    b'{"run":"0000000000000001","seq":' + b"9" * 4000 + b',"time":1}',
    b'{"run":"0000000000000001","seq":1,"time":1e999}',
    b'{"run":"\\ud800","seq":1,"time":1}',
)
WITHOUT_END = [Echo(1, seq, 0.0).pack() for seq in range(5_000)]
ANSWERS = [*([junk] for junk in JUNK), WITHOUT_END]


def test_nonsense_for_an_echo(router: Router, edge_on_air: Edge) -> None:
    asked = [0]

    def answer(query: zenoh.Query) -> None:
        asked[0] += 1
        with query:
            for data in ANSWERS[asked[0] % len(ANSWERS)]:
                query.reply(echo_key(ROBOT), data)

    assert router.session is not None
    answering = router.session.declare_queryable(echo_key(ROBOT), answer)
    until("it was told each", lambda: asked[0] > len(ANSWERS), 60.0)
    goes_on(router, edge_on_air)
    assert len(edge_on_air.lines) < 10, edge_on_air.lines
    assert memory_kb(edge_on_air.process.pid) < RSS_KB_MAX
    answering.undeclare()  # type: ignore[no-untyped-call]
    run_id = router.frames[-1].stamp.run_id
    router.echo = lambda: Echo(run_id, router.frames[-1].header.seq, 0.0)
    until("on air", lambda: any("on air" in line for line in edge_on_air.lines), 20.0)


ASKED = 2_000  # in a moment


def test_snapshots_without_end(router: Router, edge_on_air: Edge) -> None:
    assert router.session is not None
    answered, ended = [0], [0]

    def on_reply(reply: zenoh.Reply) -> None:
        answered[0] += reply.ok is not None

    def on_end() -> None:
        ended[0] += 1

    before, began_s = len(router.frames), time.monotonic()
    for _ in range(ASKED):
        handler = zenoh.handlers.Callback(on_reply, on_end)
        router.session.get(snapshot_key(ROBOT, "public"), handler, timeout=20.0)
    until("an end of each question", lambda: ended[0] == ASKED, 30.0)
    took_s = time.monotonic() - began_s
    assert 0 < answered[0] <= SNAPSHOTS_AT_ONCE + SNAPSHOTS_S * took_s + 1
    goes_on(router, edge_on_air)
    seqs = [f.header.seq for f in router.frames[before:] if not f.header.is_key]
    assert seqs == list(range(seqs[0], seqs[0] + len(seqs))), "no frame was lost meanwhile"
    assert router.snapshot() is not None, "who asks now is answered again"
    print(f"{answered[0]} of {ASKED} answered in {took_s:.1f} s")


def test_a_model_that_is_asked_for_without_end(router: Router, edge: Start, tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    mesh = bytes(2_000_000)
    (tmp_path / "meshes" / "a.stl").write_bytes(mesh)
    (tmp_path / "r.urdf").write_text(
        '<robot name="r"><link name="l"><visual><geometry><mesh filename="meshes/a.stl"/></geometry></visual>'
        "</link></robot>"
    )
    e = edge("--urdf", str(tmp_path / "r.urdf"), "--key-interval", "600", mesh_tools=False)
    feeder = Feeder(e)
    until("frames", lambda: len(router.frames) >= 10 and router.snapshot() is not None)
    assert router.session is not None
    got, refused, ended = [0], [0], [0]

    def on_reply(reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            got[0] += len(reply.ok.payload)
        else:
            refused[0] += 1

    def on_end() -> None:
        ended[0] += 1

    selector = f"{model_key(ROBOT, hashlib.sha256(mesh).hexdigest())}?off=0;len=250000"
    for _ in range(ASKED):
        router.session.get(selector, zenoh.handlers.Callback(on_reply, on_end), timeout=20.0)
    until("an end of each question", lambda: ended[0] == ASKED, 30.0)
    assert refused[0] > 0, "more than so many do not wait"
    assert got[0] >= WAITING_MAX * 250_000
    goes_on(router, e)
    assert memory_kb(e.process.pid) < RSS_KB_MAX
    [reply] = router.get(model_key(ROBOT, "manifest"))
    assert reply.ok is not None
    feeder.stop()
