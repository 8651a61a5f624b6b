"""What is taken in, what is dropped, and what a snapshot mends."""

from __future__ import annotations

import json

import pytest
from posecast_relay.core.limits import Limits
from posecast_relay.core.stream import Stream
from posecast_wire import Snapshot

from .sim import Edge, World, schema


def test_the_newest_frame_and_its_key() -> None:
    world = World()
    edge = world.on_air(key_every_s=0.08)
    stream = world.hub.robots["r"].rooms["public"].stream
    for _ in range(4):
        world.pass_time(0.03)
        assert world.publish(edge) == "taken"
    assert stream.newest is not None
    assert stream.newest.seq == 4
    assert stream.newest.key is stream.key
    assert stream.key is not None
    assert stream.key.seq == 3
    assert stream.newest.t_s == pytest.approx(world.now, abs=2e-3)


def test_late_and_repeated_frames_change_nothing() -> None:
    world = World()
    edge = world.on_air()
    first, second = edge.frame(world.now + 0.1), edge.frame(world.now + 0.2)
    assert world.publish(edge, second) == "taken"
    assert world.publish(edge, second) == "repeated"
    assert world.publish(edge, first) == "late"
    assert world.publish(edge, edge.snapshot().key) == "repeated"
    newest = world.hub.robots["r"].rooms["public"].stream.newest
    assert newest is not None
    assert newest.seq == 2


def test_numbers_go_round() -> None:
    world = World()
    edge = world.on_air()
    for edge.seq in (1 << 31) - 5, (1 << 32) - 5:  # a skip of less than half the circle is a skip
        assert world.publish(edge, edge.frame(world.now, force_key=True)) == "taken"
    before = edge.frame(world.now + 0.1, force_key=True)
    for _ in range(5):
        world.pass_time(0.03)
        assert world.publish(edge, edge.frame(world.now, force_key=True)) == "taken"
    assert edge.seq == 2
    assert world.publish(edge, before) == "late"


@pytest.mark.parametrize(
    ("payload", "outcome"),
    [
        (b"", "bad"),
        (b"\x10", "bad"),
        (b"\x14" + bytes(20), "bad"),
        (b"\x12" + bytes(20), "bad"),  # REF, which is reserved
        (b"\x20" + bytes(20), "version"),
        (b"\x10" + bytes(1 << 16), "oversized"),
    ],
)
def test_what_is_no_frame_is_counted_by_its_reason(payload: bytes, outcome: str) -> None:
    world = World()
    edge = world.on_air()
    assert world.publish(edge, payload) == outcome
    assert world.hub.outcomes[outcome] == 1


def test_a_lost_key_is_asked_for_once_a_second_and_the_newest_frame_is_not_lost() -> None:
    world = World()
    edge = world.on_air()
    _, screen = world.join()
    world.pass_time(2.0)
    world.asked.clear()
    edge.frame(world.now, force_key=True)  # lost
    for _ in range(25):  # 0.83 s
        world.pass_time(1 / 30)
        assert world.publish(edge) == "no base"
    assert world.asked == ["r"]
    world.answer(edge)
    assert screen.states[-1].seq == edge.seq
    assert screen.states[-1].codes == tuple(edge.codes)
    world.pass_time(1 / 30)
    assert world.publish(edge) == "taken"


def test_a_key_of_an_unknown_schema_waits_for_the_snapshot() -> None:
    world = World()
    edge = world.on_air()
    _, screen = world.join()
    other = Edge(edge.run_id, schema(("RKN", "LKN", "WST")), began_s=edge.began_s)
    other.seq = edge.seq
    world.pass_time(1.1)
    assert world.publish(other) == "no schema"
    assert screen.states[-1].schema.size == 2
    world.answer(other)
    assert screen.states[-1].schema.size == 3
    assert screen.states[-1].seq == other.seq


def test_a_snapshot_is_no_sign_of_life() -> None:
    world = World()
    edge = Edge(7, schema(), began_s=world.now)
    edge.frame(world.now)
    world.do(world.hub.set_token("r", True, world.now))
    world.answer(edge)
    _, screen = world.join()
    assert screen.states[-1].codes == tuple(edge.codes)
    assert screen.told("status")[-1] == {
        "type": "status",
        "robot": "silent",
        "age_ms": None,
        "seq": 0,
        "clock_ms": world.now * 1000,
    }


def test_a_snapshot_that_does_not_hold_together_changes_nothing() -> None:
    stream = Stream("r", "public", Limits(info_bytes=10))
    edge = Edge(7, schema())
    edge.frame(1.0)
    good = edge.snapshot()
    for bad, why in [
        (good._replace(key=b"\x10nothing"), "KEY is invalid"),
        (good._replace(schema=schema(scale=0.5).text), "another schema"),
        (good._replace(info={"mode": "walking"}), "info over 10 bytes"),
    ]:
        with pytest.raises(ValueError, match=why):
            stream.apply_snapshot(bad, 7, 0.0)
        assert stream.schema is None
        assert stream.newest is None
    stream.apply_snapshot(good, 7, 0.0)
    assert stream.newest is not None


def test_a_schema_that_is_none_is_refused_although_its_key_names_it() -> None:
    text = '{"type":"schema"}'
    key = Edge(7, schema()).frame(1.0)
    from posecast_wire import fnv1a32

    forged = key[:1] + fnv1a32(text.encode()).to_bytes(4, "little") + key[5:]
    stream = Stream("r", "public", Limits())
    with pytest.raises(ValueError, match="snapshot: v: "):
        stream.apply_snapshot(Snapshot(text, {}, forged, None), 7, 0.0)
    assert stream.schema is None


def test_a_new_run_becomes_current_with_its_key_and_the_old_one_is_dropped() -> None:
    world = World()
    old = world.on_air()
    world.pass_time(1.0)
    new = Edge(0x1, old.schema, began_s=world.now)
    key, plain = new.frame(world.now), new.frame(world.now + 0.03)
    assert world.publish(new, plain) == "no base"  # its KEY was lost
    assert world.publish(new, key) == "taken"
    assert world.publish(old) == "retired"
    assert world.hub.robots["r"].runs.current == 1
    assert world.hub.outcomes["retired"] == 1


def test_two_edges_with_one_id_show_as_a_conflict_that_ends() -> None:
    world = World()
    old = world.on_air()
    _, screen = world.join()
    new = Edge(0x1, old.schema, began_s=world.now)
    for _ in range(60):
        world.pass_time(1 / 30)
        world.publish(new)
        world.publish(old)
    events = screen.told("event")
    assert [(e["source"], e["state"], e["level"], e["n"]) for e in events] == [("relay", "on", "caution", 1)]
    assert all(frame.seq != old.seq for frame in screen.states[-5:])
    world.run(new, 4.0)
    assert [e["state"] for e in screen.told("event")] == ["on", "off"]


def test_age_counts_the_time_under_way() -> None:
    world = World()
    edge = world.on_air()
    world.pass_time(0.1)
    payload, stamp = edge.frame(world.now), edge.stamp(world.now)
    world.pass_time(2.0)  # held up
    world.hub.receive_frame("r", "public", payload, stamp, world.now)
    stream = world.hub.robots["r"].rooms["public"].stream
    assert stream.compute_age_s(world.now) == pytest.approx(2.0, abs=0.01)


def test_more_robots_or_views_than_allowed_are_dropped_and_counted() -> None:
    world = World(Limits(robots=2, views=1))
    edge = Edge(1, schema(), began_s=world.now)
    for robot in ("a", "b", "c"):
        world.hub.receive_frame(robot, "public", edge.frame(world.now), edge.stamp(world.now), world.now)
    world.hub.receive_frame("a", "second", edge.frame(world.now), edge.stamp(world.now), world.now)
    assert world.hub.outcomes["crowded"] == 2
    assert set(world.hub.robots) == {"a", "b"}


def event(text: str) -> dict[str, object]:
    """An event as an edge says it."""
    return {"type": "event", "t": 1.0, "level": "fault", "source": "RKN", "text": text, "state": "on"}


def told(stream: Stream) -> list[tuple[int, str]]:
    """Its events by number."""
    docs = [json.loads(kept.text) for kept in stream.events]
    return [(doc["n"], doc["text"]) for doc in docs]


def test_a_restarted_process_counts_on_from_where_the_one_before_stopped() -> None:
    before, after = (Stream("r", "public", Limits()) for _ in range(2))
    for text in "abc":
        before.number_event(event(text), 1.0)
    after.number_event(event("d"), 2.0)
    after.resume_events("p", [kept.text for kept in before.events])
    assert told(after) == [(1, "a"), (2, "b"), (3, "c"), (4, "d")]
    assert after.numbering == "p"
    assert after.number_event(event("e"), 3.0).n == 5


def test_who_takes_over_tells_nothing_twice() -> None:
    """Both hear the robot, one tells; what only the other heard comes after."""
    first, second = (Stream("r", "public", Limits()) for _ in range(2))
    for text in "ab":
        first.number_event(event(text), 1.0)
        second.number_event(event(text), 1.1)
    second.resume_events("p", [kept.text for kept in first.events])
    assert told(second) == [(1, "a"), (2, "b")]
    for text in "cd":
        first.number_event(event(text), 2.0)
        second.number_event(event(text), 2.1)
    second.number_event(event("e"), 3.0)  # the first one is gone by now
    second.resume_events("p", [kept.text for kept in first.events], told_n=2)
    assert told(second) == list(zip(range(1, 6), "abcde", strict=True))


def test_events_told_long_ago_are_not_told_again() -> None:
    mine = Stream("r", "public", Limits())
    for text in "ab":
        mine.number_event(event(text), 1.0)
    theirs = [json.dumps(event(str(n)) | {"n": n, "at": 2.0}) for n in range(50, 150)]
    mine.resume_events("p", theirs, told_n=2)
    assert told(mine) == [(n, str(n)) for n in range(50, 150)]


def test_whoever_kept_no_event_changes_no_number_and_broken_ones_change_nothing() -> None:
    stream = Stream("r", "public", Limits())
    for text in "ab":
        stream.number_event(event(text), 1.0)
    stream.resume_events("p", [])
    assert (told(stream), stream.numbering) == ([(1, "a"), (2, "b")], "p")
    for broken in ("", "[]", '{"n":"x"}', '{"text":"without"}'):
        with pytest.raises(ValueError, match=r"."):
            stream.resume_events("q", ['{"n":1,"text":"sound"}', broken])
    assert (told(stream), stream.numbering) == ([(1, "a"), (2, "b")], "p")


def test_long_schemas_have_one_bound_over_all_robots() -> None:
    world = World(Limits(schema_bytes_free=100, schemas_bytes=1000))
    wide = schema([f"joint {n}" for n in range(20)])
    assert 300 < len(wide.text) < 500
    screens = []
    for n in range(4):
        edge = Edge(0xABC, wide, began_s=world.now - 5.0)
        world.do(world.hub.set_token(f"r{n}", True, world.now))
        world.publish(edge, robot=f"r{n}")
        try:
            world.answer(edge, f"r{n}")
        except ValueError as e:
            screens.append(str(e))
    assert screens == [f"snapshot: no room for another schema of {len(wide.text)} bytes"] * 2
