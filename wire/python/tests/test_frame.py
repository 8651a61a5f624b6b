"""Headers and hashes."""

from __future__ import annotations

import importlib

import pytest
from posecast_wire import BadFrame, Header, fnv1a32, frame_id, parse_header
from posecast_wire.fnv import fnv1a32_in_python


def test_hashing_is_done_in_c() -> None:
    compiled = importlib.import_module("fnv_hash_fast._fnv_impl")

    assert str(compiled.__file__).endswith(".so")  # Python takes 11 ms for a KEY of 60 kB


def test_fnv_as_its_authors_publish_it() -> None:
    for hash_of in (fnv1a32, fnv1a32_in_python):
        assert [hash_of(s) for s in (b"", b"a", b"foobar")] == [0x811C9DC5, 0xE40C292C, 0xBF9CF968]


def test_both_hashes_agree() -> None:
    for data in (bytes(range(256)) * 5, b"\0" * 33, "Gelenk ü".encode()):
        assert fnv1a32_in_python(data) == fnv1a32(data)


def test_headers() -> None:
    key = bytes.fromhex("13010000800200000000000000000004400000")
    assert parse_header(key) == Header(True, 0x80000001, None, 2, 2.5)
    assert frame_id(key) == fnv1a32(key)
    plain = bytes.fromhex("10ffffffff0100ffff00")
    assert parse_header(plain) == Header(False, None, 0xFFFFFFFF, 1, 65535)
    with pytest.raises(BadFrame, match="tag 0x11"):
        parse_header(b"\x11" + plain[1:])
    with pytest.raises(BadFrame, match="REF frames are reserved"):
        parse_header(b"\x12" + plain[1:])
