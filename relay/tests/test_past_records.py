"""What stands in Redis beside a segment's bytes: read as it was written, and refused where it is none."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from posecast_relay.core.policy import Audience
from posecast_relay.past.segment import PastEvent, PastWord, pack_record, unpack_record

from .past_doors import PAGE_MS, make_kept

SEGMENT = make_kept(
    3,
    PAGE_MS,
    audiences=frozenset({Audience.ANYONE}),
    model="ab" * 32,
    words=(PastWord(PAGE_MS, "online"), PastWord(PAGE_MS + 9, "silent")),
    events=(PastEvent(PAGE_MS, '{"n":1,"text":"a \\"fault\\" é"}'), PastEvent(PAGE_MS + 1, '{"n":2}')),
)


def doc(**more: Any) -> bytes:
    """A record that says something else."""
    return json.dumps(json.loads(pack_record(SEGMENT)) | more).encode()


@pytest.mark.parametrize(
    "segment", [SEGMENT, make_kept(0, 0, schema=None, audiences=frozenset(), events=(), take=(1 << 64) - 1)]
)
def test_a_record_says_all_but_the_bytes(segment: Any) -> None:
    found = unpack_record("r", "public", pack_record(segment))
    assert found == replace(segment, data=b"", elsewhere_bytes=len(segment.data), schema_text=None)
    assert found.size == segment.size
    assert pack_record(found) == pack_record(segment)


def test_an_audience_of_a_later_version_sees_nothing() -> None:
    found = unpack_record("r", "public", doc(audiences=["anyone", "alumni"]))
    assert found.audiences == {Audience.ANYONE}


@pytest.mark.parametrize(
    "data",
    [
        *(b"", b"{}", b"[]", b"\xff", b"null", b"[" * 10_000, pack_record(SEGMENT)[:-1]),
        *(doc(v=0), doc(v=2), doc(v="1"), doc(take="A" * 16), doc(take="0"), doc(take=1), doc(index=-1)),
        *(doc(index=1 << 32), doc(index=True), doc(index=1.0), doc(run=None), doc(to=PAGE_MS - 1)),
        *(doc(to=PAGE_MS + 600_001), doc(**{"from": 1 << 53}), doc(frames=None), doc(schema="x")),
        *(doc(model="../" + "a" * 61), doc(bytes=1 << 40), doc(sha256=None), doc(faults="1")),
        *(doc(events=None), doc(events=[1]), doc(events=[[1]]), doc(events=[["1", "{}"]])),
        *(doc(events=[[1, "{}"]]), doc(events=[[1, ' {"n":1}']]), doc(events=[[1, '{"n":1}]']])),
        *(doc(words=[[1, "LIVE"]]), doc(words={}), doc(audiences=None), doc(events=[[-1, '{"n":1}']])),
    ],
)
def test_what_is_no_record_is_refused_in_one_line(data: bytes) -> None:
    with pytest.raises(ValueError, match=r".") as refusal:
        unpack_record("r", "public", data)
    assert "\n" not in str(refusal.value)
