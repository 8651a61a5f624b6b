"""Prepares textures: scaled down for each level, in a format that every browser displays."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache

from PIL import Image

from posecast_edge.model.finding import ModelRefused

FORMATS = ("PNG", "JPEG", "BMP", "TGA", "TIFF", "WEBP", "GIF")
PIXELS_MAX = 4096 * 4096  # of one picture, at four bytes each; even a file of 50 kB can have so many
JPEG_PIXELS_MAX = 64_000_000  # of a JPEG, unpacked at an eighth of its size unless it is progressive
BAND = 256  # rows of a large picture that are scaled at a time
LOOK = 128  # pixels a side: enough to check that a picture can be read, and for its mean
PIXELS_IN_ALL = 1 << 30  # of a robot's pictures; further ones are left out
PIXELS_A_BYTE = 400  # a PNG of one colour has about 340
SCANS_MAX = 100  # of a JPEG; one or about ten are normal. Each scan needs only ten bytes but costs all pixels
PIXELS_CLAIMED = 64_000_000  # of a robot's pictures, beyond the number that their bytes justify
KEPT_PIXEL = 8  # bytes of a pixel without compression: a larger file holds more than a picture
KEPT_HEAD = 4096
START_OF_SCAN = b"\xff\xda"  # never occurs within a scan
JPEG_QUALITY = 85
LOOKS_MAX = 1000  # results per picture and size that are cached while a robot is built


@dataclass(frozen=True)
class Picture:
    """An encoded picture; `type` is image/png or image/jpeg."""

    data: bytes
    type: str


class Pictures:
    """The pictures of one robot; each is checked once, even if many surfaces use it."""

    def __init__(self) -> None:
        self._reasons: dict[bytes, str] = {}  # why a picture can't be used, "" where it can
        self._pixels = self._claimed = 0

    def validate(self, data: bytes) -> bytes:
        """Return `data`. Raises ModelRefused when it is not a picture, damaged, or too large."""
        if data not in self._reasons:
            self._reasons[data] = self._look_at(data)
        if reason := self._reasons[data]:
            raise ModelRefused(reason)
        return data

    def _look_at(self, data: bytes) -> str:
        try:
            with _reading():
                image = _opened(data)
                pixels = image.width * image.height
                claimed = max(0, pixels - PIXELS_A_BYTE * len(data))
                if self._pixels + pixels > PIXELS_IN_ALL:
                    return f"left out: the robot's pictures have over {PIXELS_IN_ALL >> 20} million pixels"
                if claimed and self._claimed + claimed > PIXELS_CLAIMED:
                    return f"left out: {image.width} × {image.height} pixels in {len(data)} bytes"
                self._pixels += pixels
                self._claimed += claimed
                _plain(image, LOOK)
        except ModelRefused as e:
            return e.reason
        return ""


@lru_cache(LOOKS_MAX)
def fit_picture(data: bytes, side_max: int) -> Picture:
    """Scale a picture to at most `side_max` pixels a side; a PNG or JPEG that fits is kept as it is. Raises
    ModelRefused when it is not a picture."""
    with _reading():
        image = _opened(data)
        fits = max(image.size) <= side_max
        if fits:
            image.load()
        small = len(data) <= image.width * image.height * KEPT_PIXEL + KEPT_HEAD
        if fits and small and image.format in ("PNG", "JPEG"):
            return Picture(data, f"image/{image.format.lower()}")
        shown = _plain(image, side_max)
        if not fits:
            shown.thumbnail((side_max, side_max), Image.Resampling.LANCZOS)
        out = io.BytesIO()
        if shown.mode == "RGBA":
            shown.save(out, "PNG", optimize=True)
            return Picture(out.getvalue(), "image/png")
        shown.save(out, "JPEG", quality=JPEG_QUALITY)
        return Picture(out.getvalue(), "image/jpeg")


@lru_cache(LOOKS_MAX)
def compute_mean_colour(data: bytes) -> tuple[float, float, float]:
    """The picture's mean colour as display (sRGB) values 0 … 1. Raises ModelRefused when it is not a
    picture."""
    with _reading():
        shown = _plain(_opened(data), LOOK).convert("RGB")
        r, g, b = shown.resize((1, 1), Image.Resampling.BOX).getpixel((0, 0))  # type: ignore[misc]
        return (r / 255, g / 255, b / 255)


def _opened(data: bytes) -> Image.Image:
    """Open a picture: reads its header and checks its size, but does not unpack its pixels."""
    image = Image.open(io.BytesIO(data), formats=FORMATS)
    by_parts = image.format == "JPEG" and not image.info.get("progressive")
    most = JPEG_PIXELS_MAX if by_parts else PIXELS_MAX
    if image.width * image.height > most:
        side = int(most**0.5)
        raise ModelRefused(
            f"a picture of {image.width} × {image.height} pixels; at most {side} × {side} are supported"
        )
    if any(tile[0] == "libtiff" for tile in image.tile):  # libtiff writes messages to stderr
        raise ModelRefused("a compressed TIFF")
    if any(tile[0] == "jpeg" for tile in image.tile) and data.count(START_OF_SCAN) > SCANS_MAX:
        raise ModelRefused(f"a JPEG of more than {SCANS_MAX} scans")
    return image


def _plain(image: Image.Image, side: int) -> Image.Image:
    """Its pixels, with any transparency. A large picture is reduced to what a good picture of `side` needs.
    Never holds all pixels twice."""
    image.draft("RGB", (side, side))
    mode = "RGBA" if image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info else "RGB"
    less = max(image.size) // (2 * side)
    if less < 2:
        if image.mode != mode:
            return image.convert(mode)
        image.load()
        return image
    shown = Image.new(mode, (-(-image.width // less), -(-image.height // less)))
    rows = max(1, BAND // less)
    for row in range(0, shown.height, rows):
        band = image.crop((0, row * less, image.width, min(image.height, (row + rows) * less)))
        shown.paste(band.convert(mode).reduce(less), (0, row))
    return shown


@contextmanager
def _reading() -> Iterator[None]:
    """Turn every exception of Pillow into ModelRefused: broken pictures fail in many ways."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            yield
    except ModelRefused:
        raise
    except Exception:
        raise ModelRefused("not a readable picture: export it as PNG or JPEG") from None
