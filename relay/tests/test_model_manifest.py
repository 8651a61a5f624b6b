"""A manifest from a stranger: read strictly, at a cost in proportion, and never a mistake of ours."""

from __future__ import annotations

import json
import sys
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from posecast_relay.models.manifest import (
    BYTES_MAX,
    FILE_BYTES_MAX,
    FILES_MAX,
    MODEL_BYTES_MAX,
    Entry,
    ManifestError,
    read_manifest,
)

GOOD = {"path": "a", "size": 1, "sha256": "0" * 64, "type": "model/stl"}
PATHS = [
    "robot.urdf",
    "meshes/2/hand_1.stl",
    "level-0.glb",
    "c/d.dae",
    "Größe.png",
    ".hidden",
    "..a",
    "a+b@2=c,~",
]
NO_PATHS = [
    r"/a",
    r"a/",
    r"a//b",
    r".",
    r"..",
    r"../a",
    r"a/../b",
    r"a/.",
    r"./a",
    r"a\b",
    r"a?b",
    r"a#b",
    r"a%2e",
    r"a:b",
]
SIZES = ["1e999", "-1e999", "NaN", "Infinity", "1.0", "1e3", "-1", "true", "null", '"1"', "[]"]


def of(*files: Any) -> bytes:
    """A manifest of these."""
    return json.dumps({"v": 2, "files": list(files)}).encode()


def test_files_by_path() -> None:
    found = read_manifest(of(GOOD, GOOD | {"path": "b", "sha256": "1" * 64, "size": 0, "type": "<script>"}))
    assert found == {"a": Entry("0" * 64, 1, "model/stl"), "b": Entry("1" * 64, 0, "")}


@pytest.mark.parametrize("path", [*PATHS, "a b/c d.dae"])
def test_paths_as_robots_have_them(path: str) -> None:
    assert list(read_manifest(of(GOOD | {"path": path}))) == [path]


@pytest.mark.parametrize(
    "path",
    [*NO_PATHS, "", " a", "a/ b", "a\n", "a\u202eb", "\ud800", "\x00", "x" * 201, 7, None],
    ids=ascii,
)
def test_paths_that_are_none(path: Any) -> None:
    with pytest.raises(ManifestError):
        read_manifest(of(GOOD | {"path": path}))


@pytest.mark.parametrize("size", [*SIZES, str(FILE_BYTES_MAX + 1), "9" * 5000], ids=lambda size: size[:12])
def test_sizes_that_are_none(size: str) -> None:
    with pytest.raises(ManifestError):
        read_manifest(of(GOOD).replace(b'"size": 1', b'"size": ' + size.encode()))


@pytest.mark.parametrize(
    ("files", "why"),
    [
        ([GOOD, GOOD], "twice"),
        ([GOOD, GOOD | {"path": "b", "size": 2}], "another size"),
        ([GOOD | {"sha256": "A" * 64}], "hex"),
        ([GOOD | {"sha256": 7}], "hex"),
        ([7], "object"),
        ([GOOD | {"path": str(n)} for n in range(FILES_MAX + 1)], "at most"),
        (
            [
                GOOD | {"path": str(n), "sha256": f"{n:064x}", "size": FILE_BYTES_MAX}
                for n in range(MODEL_BYTES_MAX // FILE_BYTES_MAX + 1)
            ],
            "in all",
        ),
    ],
    ids=["path", "size", "capitals", "number", "no object", "many", "much"],
)
def test_what_does_not_hold_together(files: list[Any], why: str) -> None:
    with pytest.raises(ManifestError, match=why) as refused:
        read_manifest(of(*files))
    assert len(str(refused.value)) < 200
    assert str(refused.value).isprintable()


@pytest.mark.parametrize(
    "data",
    [
        *(b"", b"{", b"[]", b"7", b'{"files":{}}', b'{"files":7}', b"\xff", b"\xef\xbb\xbf{}"),
        *(b'{"files":[],"a":"\\ud800"}', b"[" * 100_000, b" " * (BYTES_MAX + 1)),
        b'{"files":' + b"[" * 5000 + b"]" * 5000 + b"}",
    ],
    ids=lambda data: ascii(data[:20]),
)
def test_what_is_no_manifest(data: bytes) -> None:
    with pytest.raises(ManifestError):
        read_manifest(data)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.just("0" * 64),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from([*GOOD, "files"]), inner),
)


@given(st.binary(max_size=200) | JSON.map(lambda doc: json.dumps({"files": [doc, GOOD]}).encode()))
@settings(deadline=None)
def test_whatever_it_is_it_is_read_or_refused_in_a_line(data: bytes) -> None:
    said = ""
    try:
        read_manifest(data)
    except ManifestError as e:
        said = str(e)
    assert said.isprintable()


def work(data: bytes) -> int:
    """Calls that reading it takes, of Python's functions and of C's."""
    calls = 0

    def count(_frame: Any, event: str, _arg: Any) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    sys.setprofile(count)
    try:
        read_manifest(data)
    except ManifestError:
        pass
    finally:
        sys.setprofile(None)
    return calls


@pytest.mark.parametrize("kind", ["distinct", "last twice", "long paths"])
def test_the_cost_is_in_proportion(kind: str) -> None:
    def manifest(n: int) -> bytes:
        stem = "x" * 190 if kind == "long paths" else ""
        files = [GOOD | {"path": f"{stem}{i}"} for i in range(n)]
        return of(*files, *(files[-1:] if kind == "last twice" else []))

    small, middle, large = (work(manifest(n)) for n in (200, 800, 3200))
    assert large < 1.2 * 4 * middle < 1.2 * 1.2 * 16 * small
