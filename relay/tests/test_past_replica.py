"""What a gateway knows of a view follows Redis's stream, whatever of it is none."""

from __future__ import annotations

from posecast_relay.past.segment import KeptSegment, pack_record
from posecast_relay.redis.past_reader import BEGINNING, PastReplica

from .past_doors import PAGE_MS, make_kept

SEGMENTS = [make_kept(n, PAGE_MS + 4000 * n) for n in range(5)]


def told(*records: tuple[bytes, KeptSegment | None]) -> list[bytes]:
    """As Redis tells them; None: something else."""
    return [each for id_, of in records for each in (id_, b"?" if of is None else pack_record(of))]


def list_indexes(replica: PastReplica) -> list[int]:
    """Of what it knows."""
    return [segment.name.index for segment in replica.kept.list_segments("r", "public")]


def test_it_follows_the_stream() -> None:
    passed_over: list[str] = []
    replica = PastReplica("r", "public", passed_over.append)
    assert (replica.newest, replica.count) == (BEGINNING, 0)
    assert replica.append(told((b"9-0", SEGMENTS[0]), (b"9-1", None), (b"9-2", SEGMENTS[1])))
    assert not replica.append(told((b"10-0", SEGMENTS[0]), (b"10-1", None)))  # a name twice
    assert replica.append(told((b"10-2", SEGMENTS[2]), (b"11-0", SEGMENTS[3])))
    assert (replica.newest, replica.count) == (b"11-0", 7)
    assert len(passed_over) == 3
    assert list_indexes(replica) == [0, 1, 2, 3]
    replica.drop_before(b"9-2")  # 9 is before 10, as numbers are
    assert (replica.count, list_indexes(replica)) == (5, [1, 2, 3])
    replica.drop(SEGMENTS[2].name)
    assert (replica.count, list_indexes(replica)) == (5, [1, 3])
    replica.drop_before(b"11-0")
    assert (replica.count, list_indexes(replica)) == (1, [3])
    replica.drop_before(b"12-0")
    assert (replica.newest, replica.count, list_indexes(replica)) == (BEGINNING, 0, [])
