"""A relay that answers nonsense, or asks without end: the robot's frames go on, in little memory."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import zenoh
from edge_stage import ROBOT, Edge, Feeder, Router, until
from posecast_edge.uplink.model_server import WAITING_MAX
from posecast_edge.uplink.view_publisher import SNAPSHOTS_AT_ONCE, SNAPSHOTS_S
from posecast_wire.keys import Echo, echo_key, model_key, snapshot_key
from test_model_background import RSS_KB_MAX, memory_kb

Start = Callable[..., Edge]


@pytest.fixture
def edge_on_air(router: Router, edge: Start, profile_file: Path) -> Iterator[Edge]:
    e = edge("--profile", str(profile_file), "--hz", "30", "--key-interval", "600")
    feeder = Feeder(e)
    until(lambda: len(router.frames) >= 10, "frames")
    yield e
    feeder.stop()


def goes_on(router: Router, edge: Edge, frames: int = 60) -> None:
    """Frame after frame, none left out."""
    first = len(router.frames)
    until(lambda: len(router.frames) >= first + frames, "frames go on", 20.0)
    seqs = [f.header.seq for f in router.frames[first:] if not f.header.is_key]
    assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))
    assert edge.process.poll() is None
    assert not any("Traceback" in line for line in edge.lines)


JUNK = {
    "nothing": b"",
    "no UTF-8": b"\xff\xfe",
    "no object": b"[]",
    "another document": b'{"run":5}',
    "deep": b"[" * 4000,
    "many digits": b'{"run":"0000000000000001","seq":' + b"9" * 4000 + b',"time":1}',
    "1e999": b'{"run":"0000000000000001","seq":1,"time":1e999}',
    "half a character": b'{"run":"\\ud800","seq":1,"time":1}',
    "long": b" " * 100_000,
    "huge": b" " * 8_000_000,
}


@pytest.mark.parametrize("kind", JUNK)
def test_nonsense_for_an_echo(router: Router, edge_on_air: Edge, kind: str) -> None:
    asked = [0]

    def answer(query: zenoh.Query) -> None:
        asked[0] += 1
        with query:
            query.reply(echo_key(ROBOT), JUNK[kind])

    assert router.session is not None
    answering = router.session.declare_queryable(echo_key(ROBOT), answer)
    goes_on(router, edge_on_air)
    until(lambda: asked[0] >= 4, "it is asked again")
    assert len(edge_on_air.lines) < 10, edge_on_air.lines
    assert memory_kb(edge_on_air.process.pid) < RSS_KB_MAX
    answering.undeclare()  # type: ignore[no-untyped-call]
    run_id = router.frames[-1].stamp.run_id
    router.echo = lambda: Echo(run_id, router.frames[-1].header.seq, 0.0)
    until(lambda: any("on air" in line for line in edge_on_air.lines), "on air", 20.0)


def test_answers_without_end_to_one_echo(router: Router, edge_on_air: Edge) -> None:
    asked = [0]

    def answer(query: zenoh.Query) -> None:
        asked[0] += 1
        with query:
            for seq in range(20_000):
                query.reply(echo_key(ROBOT), Echo(1, seq, 0.0).pack())

    assert router.session is not None
    answering = router.session.declare_queryable(echo_key(ROBOT), answer)
    goes_on(router, edge_on_air)
    until(lambda: asked[0] >= 3, "it is asked again", 20.0)
    assert memory_kb(edge_on_air.process.pid) < RSS_KB_MAX
    answering.undeclare()  # type: ignore[no-untyped-call]


def test_ten_thousand_snapshots_a_second(router: Router, edge_on_air: Edge) -> None:
    assert router.session is not None
    answered, ended = [0], [0]

    def on_reply(reply: zenoh.Reply) -> None:
        answered[0] += reply.ok is not None

    def on_end() -> None:
        ended[0] += 1

    before, began_s = len(router.frames), time.monotonic()
    for _ in range(10_000):
        handler = zenoh.handlers.Callback(on_reply, on_end)
        router.session.get(snapshot_key(ROBOT, "public"), handler, timeout=20.0)
    until(lambda: ended[0] == 10_000, "an end of each question", 30.0)
    took_s = time.monotonic() - began_s
    assert 0 < answered[0] <= SNAPSHOTS_AT_ONCE + SNAPSHOTS_S * took_s + 1
    goes_on(router, edge_on_air)
    seqs = [f.header.seq for f in router.frames[before:] if not f.header.is_key]
    assert seqs == list(range(seqs[0], seqs[0] + len(seqs))), "no frame was lost meanwhile"
    assert router.snapshot() is not None, "who asks now is answered again"
    print(f"{answered[0]} of 10,000 answered in {took_s:.1f} s")


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
    until(lambda: len(router.frames) >= 10 and router.snapshot() is not None, "frames")
    assert router.session is not None
    got, refused, ended = [0], [0], [0]

    def on_reply(reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            got[0] += len(reply.ok.payload)
        else:
            refused[0] += 1

    def on_end() -> None:
        ended[0] += 1

    for _ in range(2_000):
        selector = f"{model_key(ROBOT, hashlib.sha256(mesh).hexdigest())}?off=0;len=250000"
        router.session.get(selector, zenoh.handlers.Callback(on_reply, on_end), timeout=20.0)
    until(lambda: ended[0] == 2_000, "an end of each question", 30.0)
    assert refused[0] > 0, "more than so many do not wait"
    assert got[0] >= WAITING_MAX * 250_000
    goes_on(router, e)
    assert memory_kb(e.process.pid) < RSS_KB_MAX
    [reply] = router.get(model_key(ROBOT, "manifest"))
    assert reply.ok is not None
    feeder.stop()
