"""Keys of the past in an object store: written and read back; whatever else lies there is foreign."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posecast_relay.archive.names import (
    ArchivedName,
    make_day_key,
    make_index_key,
    make_schema_key,
    name_segment,
    read_day,
    read_page,
    read_segment_key,
)
from posecast_relay.core.policy import Audience
from posecast_relay.past.segment import SegmentName

from .past_doors import DAY, PAGE_MS, make_kept

FIRST, LAST = 946_684_800_000, 4_102_444_800_000 - 600_001  # 2000 to 2099


def test_a_key_says_what_a_segment_is() -> None:
    segment = make_kept(7, PAGE_MS + 61_234, audiences=frozenset({Audience.SIGNED_IN, Audience.ANYONE}))
    key = name_segment(segment).key
    assert key == (
        f"r/public/{DAY}/11-20/{PAGE_MS + 61_234}-{PAGE_MS + 65_234}-{10:016x}-7-{segment.size}-as.segment"
    )
    assert read_segment_key(key) == name_segment(segment)
    nobody = name_segment(make_kept(7, PAGE_MS, audiences=frozenset()))
    assert nobody.key.endswith("-x.segment")
    assert read_segment_key(nobody.key) == nobody
    assert make_index_key("r", "public", PAGE_MS + 1) == f"r/public/{DAY}/11-20/index.json"
    assert make_day_key("r", "public", PAGE_MS + 1) == f"r/public/{DAY}/day.json"
    assert make_schema_key("r", b"\xab" * 32) == f"r/schemas/{'ab' * 32}.json"


@given(
    st.integers(FIRST, LAST),
    st.integers(0, 600_000),
    st.integers(0, (1 << 64) - 1),
    st.integers(0, (1 << 32) - 1),
    st.integers(0, 3 << 20),
    st.frozensets(st.sampled_from(Audience)),
)
def test_every_name_comes_back(
    from_ms: int, length: int, take: int, index: int, size: int, audiences: frozenset[Audience]
) -> None:
    name = ArchivedName(
        SegmentName("hubo-2", "joints", take, index), from_ms, from_ms + length, size, audiences
    )
    assert read_segment_key(name.key) == name


KEY = name_segment(make_kept(7, PAGE_MS)).key


@pytest.mark.parametrize(
    "key",
    [
        "",
        KEY + "#1",
        KEY + "\n",
        KEY.replace(".segment", ".tmp"),
        KEY.replace("11-20", "11-30"),
        KEY.replace(DAY, "2026-11-19"),
        KEY.replace("-als.", "-sal."),
        KEY.replace("-als.", "-."),
        KEY.replace("-7-", "-07-"),
        KEY.replace("-7-", "-4294967296-"),
        KEY.replace("-7-", "-٧-"),
        KEY.replace("r/public", "R/public"),
        KEY.replace("r/public", "r/models"),
        KEY.replace("r/public", "tombstones/public"),
        "x/" + KEY,
        KEY.replace(f"{PAGE_MS}-", f"{'9' * 16}-", 1),
        KEY.replace(f"-{PAGE_MS + 4000}-", f"-{PAGE_MS - 1}-"),
        KEY.replace(f"-{PAGE_MS + 4000}-", f"-{PAGE_MS + 600_001}-"),
        "r/public/2026-02-30/11-20/0-0-000000000000000a-0-0-x.segment",
    ],
)
def test_what_is_none_of_ours_is_foreign(key: str) -> None:
    assert read_segment_key(KEY) is not None
    assert read_segment_key(key) is None


def test_days_and_pages() -> None:
    assert read_day(DAY) == PAGE_MS - PAGE_MS % 86_400_000
    assert [read_day(text) for text in ("2026-02-30", "2026-1-01", "", f"{DAY}x")] == [None] * 4
    assert read_page("11-20") == 11 * 3_600_000 + 20 * 60_000
    assert [read_page(text) for text in ("24-00", "11-25", "11-60", "")] == [None] * 4


def test_a_long_key_is_refused() -> None:
    for key in ("1" * 1_000_000, "/" * 1_000_000, f"r/public/{DAY}/11-20/" + "1-" * 500_000):
        assert read_segment_key(key) is None
