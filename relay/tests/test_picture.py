"""How large a picture is, by its first bytes, and what is none."""

from __future__ import annotations

import contextlib

import pytest
from posecast_relay.models.picture import PICTURE_TYPES, SIDE_PX_MAX, PictureError, read_picture_size

from .pictures import JPEG, WEBP_EXTENDED, WEBP_LOSSLESS, WEBP_LOSSY, make_png

GOOD = [
    (make_png(5, 3), "image/png"),
    (JPEG, "image/jpeg"),
    (b"\xff\xd8" + b"\xff" * 9 + JPEG[3:], "image/jpeg"),
    (JPEG.replace(b"\xff\xc0", b"\xff\xc2"), "image/jpeg"),
    (WEBP_LOSSY, "image/webp"),
    (WEBP_LOSSLESS, "image/webp"),
    (WEBP_EXTENDED, "image/webp"),
]


@pytest.mark.parametrize(("data", "type_"), GOOD, ids=lambda each: each if isinstance(each, str) else "")
def test_a_picture_is_as_large_as_its_head_says(data: bytes, type_: str) -> None:
    assert read_picture_size(data, type_) == (5, 3)
    for other in (*(each for each in PICTURE_TYPES if each != type_), "text/html", ""):
        with pytest.raises(PictureError):
            read_picture_size(data, other)
    for cut in range(len(data)):
        with contextlib.suppress(PictureError):
            assert read_picture_size(data[:cut], type_) == (5, 3)


@pytest.mark.parametrize("type_", PICTURE_TYPES)
@pytest.mark.parametrize("data", [b"", b"<html><script>alert(1)</script>" * 9, b"GIF89a" + bytes(99)])
def test_what_is_no_picture_is_refused(data: bytes, type_: str) -> None:
    with pytest.raises(PictureError, match=f"not a valid {type_}"):
        read_picture_size(data, type_)


@pytest.mark.parametrize("side", [(50_000, 50_000), (SIDE_PX_MAX + 1, 1), (1, 2**32 - 1), (0, 5), (5, 0)])
def test_one_that_would_fill_memory_or_has_no_side_is_refused(side: tuple[int, int]) -> None:
    with pytest.raises(
        PictureError, match=f"{side[0]} × {side[1]} px; want 1 to {SIDE_PX_MAX} for each side"
    ):
        read_picture_size(make_png(*side), "image/png")
    assert read_picture_size(make_png(SIDE_PX_MAX, 1), "image/png") == (SIDE_PX_MAX, 1)
