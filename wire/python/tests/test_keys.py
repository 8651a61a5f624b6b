"""Zenoh names and payloads."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posecast_wire import (
    Echo,
    Snapshot,
    Stamp,
    alive_key,
    check_name,
    echo_key,
    event_key,
    frame_key,
    model_key,
    snapshot_key,
)

from .streams import SLOW

HASH = "ab" * 32


def test_keys() -> None:
    assert alive_key("hubo-2") == "posecast/v1/hubo-2/alive"
    assert frame_key("r", "public") == "posecast/v1/r/public/frame"
    assert event_key("r", "public") == "posecast/v1/r/public/event"
    assert snapshot_key("r", "public") == "posecast/v1/r/public/snapshot"
    assert echo_key("r") == "posecast/v1/r/echo"
    assert [model_key("r", p) for p in ("manifest", HASH, "**")] == [
        "posecast/v1/r/model/manifest",
        f"posecast/v1/r/model/{HASH}",
        "posecast/v1/r/model/**",
    ]


@pytest.mark.parametrize(
    "name",
    ["", "*", "a*", "**", "a/b", "-a", "A", "a_b", "é", "a" * 64, "a\n", "a b", "$*", "\u202e" * 9_000],
)
def test_names_that_zenoh_would_take_and_we_do_not(name: str) -> None:
    with pytest.raises(ValueError, match="use 1 to 63 of") as caught:
        frame_key(name, "public")
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 2_000
    with pytest.raises(ValueError, match=r"^view "):
        frame_key("r", name)


def test_names_that_fit() -> None:
    for name in ("a", "0", "hubo-2", "a" * 63, "a--b-"):
        assert check_name("robot", name) == name
    for part in ("../x", "", "*", HASH.upper(), HASH[:-1]):
        with pytest.raises(ValueError, match="model part"):
            model_key("r", part)


def test_stamp() -> None:
    stamp = Stamp((1 << 64) - 1, 5)
    assert stamp.pack() == b"\xff" * 8 + b"\5" + b"\0" * 7
    assert Stamp.unpack(stamp.pack()) == stamp
    for wrong in (b"", b"1" * 15, b"1" * 17, b"\0" * 16):
        with pytest.raises(ValueError, match="stamp"):
            Stamp.unpack(wrong)


@pytest.mark.parametrize("model", [None, HASH])
def test_snapshot(model: str | None) -> None:
    snapshot = Snapshot('{"type":"schema","unit":"°C"}', {"mode": "walking"}, b"\x13\0\xff", model)
    assert Snapshot.unpack(snapshot.pack()) == snapshot


def test_older_readers_find_a_ref_of_null_and_a_ref_is_not_read() -> None:
    snapshot = Snapshot("s", {}, b"k", HASH)
    doc = json.loads(snapshot.pack())
    assert doc["ref"] is None
    for ref in ("Eg==", "a", 5):
        assert Snapshot.unpack(json.dumps(doc | {"ref": ref}).encode()) == snapshot


@pytest.mark.parametrize(
    ("member", "value"),
    [
        ("schema", 1),
        ("info", []),
        ("info", {"a": 1}),
        ("key", None),
        ("key", 5),
        ("key", "not base64!"),
        ("key", "é"),
        ("model", "x"),
        ("model", 1),
    ],
)
def test_a_snapshot_with_a_wrong_member(member: str, value: object) -> None:
    doc = json.loads(Snapshot("s", {}, b"k", HASH).pack())
    with pytest.raises(ValueError, match=f"snapshot: {member} must be"):
        Snapshot.unpack(json.dumps(doc | {member: value}).encode())


def test_echo() -> None:
    echo = Echo(0xFEDCBA9876543210, 7, 1763706000.25)
    assert json.loads(echo.pack()) == {"run": "fedcba9876543210", "seq": 7, "time": 1763706000.25}
    assert Echo.unpack(echo.pack()) == echo
    assert Echo.unpack(Echo(0, 0, 0.0).pack()).run_id == 0
    over = Echo(1, 2, 3.0, "120 frames a second a view")
    assert Echo.unpack(over.pack()) == over


@pytest.mark.parametrize(
    ("member", "value"),
    [
        ("run", 1),
        ("run", "xyz"),
        ("seq", -1),
        ("seq", True),
        ("seq", 1 << 32),
        ("time", None),
        ("time", -1),
        ("time", 1e13),
        ("time", True),
        ("over", 5),
        ("over", None),
        ("over", "two\nlines"),
        ("over", "x" * 201),
    ],
)
def test_an_echo_with_a_wrong_member(member: str, value: object) -> None:
    doc = json.loads(Echo(1, 2, 3.0).pack())
    with pytest.raises(ValueError, match=f"echo: {member} must be"):
        Echo.unpack(json.dumps(doc | {member: value}).encode())


@pytest.mark.parametrize(
    "wrong", ["\ufeff{}", '{"\\ud800":0}', '["\\udfff"]', "[1e999]", "9" * 5000, "[" * 65 + "]" * 65]
)
def test_what_is_no_json_is_one_short_line(wrong: str) -> None:
    for kind in (Snapshot, Echo):
        with pytest.raises(ValueError, match=r"^(snapshot|echo): not JSON: ") as caught:
            kind.unpack(wrong.encode())
        assert str(caught.value).isprintable()
        assert len(str(caught.value)) < 300


def test_info_that_is_not_unicode_is_refused_with_its_snapshot() -> None:
    doc = json.loads(Snapshot("s", {}, b"k", None).pack())
    for info in ({"mode": "\ud800"}, {"\ud800": "walking"}):
        with pytest.raises(ValueError, match="snapshot: not JSON: a text that is not Unicode"):
            Snapshot.unpack(json.dumps(doc | {"info": info}).encode())


@SLOW
@given(st.binary(max_size=100))
def test_noise_is_a_value_error(noise: bytes) -> None:
    for kind in (Snapshot, Echo):
        with pytest.raises(ValueError, match=r"snapshot|echo"):
            kind.unpack(noise)
