"""Two audiences, two streams: what one may not see never leaves the lab."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from pathlib import Path

import zenoh
from edge_stage import PROFILE, ROBOT, Edge, Router
from posecast_testing import until
from posecast_wire.decoder import Decoder
from posecast_wire.keys import Snapshot, event_key, frame_key, snapshot_key

VIEWS = """
[views.public]
fields = ["pos"]
info = ["mode"]
hz = 5
scales = { pos = 0.01 }
[views.lab]
"""


HIDDEN = "CANARY-7319"


def test_each_view_is_a_stream_of_its_own(router: Router, edge: Callable[..., Edge], tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(PROFILE + VIEWS, encoding="utf-8")
    assert router.session is not None
    told: list[tuple[str, bytes]] = []

    def tell(sample: zenoh.Sample) -> None:
        told.append((str(sample.key_expr), sample.payload.to_bytes()))

    def events() -> list[str]:
        return [key for key, said in list(told) if json.loads(said)["type"] == "event"]

    listening = router.session.declare_subscriber(f"posecast/v1/{ROBOT}/*/event", tell)
    e = edge("--profile", str(path), "--hz", "30")
    stop = threading.Event()

    def feed() -> None:
        n = 0
        while not stop.wait(0.01):
            n += 1
            jam = ["jam"] if n % 50 > 25 else []
            info = {"mode": "walks", f"driver {HIDDEN}": f"overheats {HIDDEN} {n // 50}"}
            e.send(t=n * 0.01, pos=[n * 0.0123, 0.5], ftf=[40.0], flags={"RKN": jam}, info=info)

    feeder = threading.Thread(target=feed, daemon=True)
    feeder.start()
    keys = {view: frame_key(ROBOT, view) for view in ("public", "lab")}

    def of(view: str) -> list[bytes]:
        return [f.data for f in list(router.frames) if f.key == keys[view]]

    try:
        until("frames and events", lambda: len(of("public")) >= 10 and len(events()) >= 2)
        public, lab = len(of("public")), len(of("lab"))
        assert lab > 3 * public, "each at its own rate"
        assert set(events()) == {event_key(ROBOT, "lab")}, "a fault is no business of a view without flags"
        schemas, of_public = {}, [said for key, said in told if key == event_key(ROBOT, "public")]
        for view in keys:
            reply = router.get(snapshot_key(ROBOT, view))[0].ok
            assert reply is not None
            snapshot = Snapshot.unpack(reply.payload.to_bytes())
            schemas[view] = snapshot.schema
            if view == "public":
                of_public.append(reply.payload.to_bytes())
                assert snapshot.info == {"mode": "walks"}, "the texts that it names"
            else:
                assert HIDDEN in json.dumps(snapshot.info)
        assert len(of_public) >= 2, "info of its own, and the snapshot"
        assert not [said for said in of_public if HIDDEN.encode() in said]
        assert not [w for w in ("ftf", "flags", "jam", "foot", "500") if w in schemas["public"]]
        for view, fields in (("public", ["pos"]), ("lab", ["ref", "pos", "ftf", "flags"])):
            decoder = Decoder()
            decoder.add_schema(schemas[view])
            frames = of(view)
            start = next(i for i, data in enumerate(frames) if data[0] & 1)
            decoded = [decoder.decode(data) for data in frames[start:]]
            assert [f.name for f in decoded[-1].schema.fields] == fields
            assert [d.seq for d in decoded] == list(range(decoded[0].seq, decoded[0].seq + len(decoded)))
            pos = decoded[-1].values("pos")[0]
            assert pos is not None
            assert abs(pos - decoded[-1].t_s * 1.23) < (0.01 if view == "public" else 0.002)
    finally:
        stop.set()
        feeder.join()
        listening.undeclare()  # type: ignore[no-untyped-call]
