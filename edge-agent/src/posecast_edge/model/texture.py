"""Pictures on surfaces: made small enough for each level, in a format that every browser draws."""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass

from PIL import Image

from posecast_edge.model.finding import ModelRefused

FORMATS = ("PNG", "JPEG", "BMP", "TGA", "TIFF", "WEBP", "GIF")
PIXELS_MAX = 64_000_000
JPEG_QUALITY = 85


@dataclass(frozen=True)
class Picture:
    """An encoded picture: `type` is image/png or image/jpeg."""

    data: bytes
    type: str


def fitted(data: bytes, side_max: int) -> Picture:
    """At most `side_max` pixels a side; a PNG or JPEG that fits is kept. ModelRefused when it is none."""
    image = _opened(data)
    fits = max(image.size) <= side_max
    if fits and image.format in ("PNG", "JPEG"):
        return Picture(data, f"image/{image.format.lower()}")
    clear = image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info
    image = image.convert("RGBA" if clear else "RGB")
    if not fits:
        image.thumbnail((side_max, side_max), Image.Resampling.LANCZOS)
    out = io.BytesIO()
    if clear:
        image.save(out, "PNG", optimize=True)
        return Picture(out.getvalue(), "image/png")
    image.save(out, "JPEG", quality=JPEG_QUALITY)
    return Picture(out.getvalue(), "image/jpeg")


def checked_picture(data: bytes) -> bytes:
    """The same. ModelRefused when it is no picture, a broken one, or far too large."""
    _opened(data)
    return data


def mean_colour(data: bytes) -> tuple[float, float, float]:
    """Its mean as display values 0 … 1. ModelRefused when it is no picture."""
    r, g, b = _opened(data).convert("RGB").resize((1, 1), Image.Resampling.BOX).getpixel((0, 0))  # type: ignore[misc]
    return (r / 255, g / 255, b / 255)


def _opened(data: bytes) -> Image.Image:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            image = Image.open(io.BytesIO(data), formats=FORMATS)
            if image.width * image.height > PIXELS_MAX:
                raise ModelRefused(f"a picture of {image.width} × {image.height} pixels")
            image.load()
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError, Warning) as e:
        raise ModelRefused(f"no picture that is read: {str(e)[:60]}") from None
    return image
