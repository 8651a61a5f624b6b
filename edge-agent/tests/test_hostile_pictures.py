"""Pictures of a model that once raised what nobody caught, or cost what nobody had."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import pytest
from mesh_parsers import png
from model_parsers import jpeg_scans
from model_stage import build_robot, cube_obj, link, mesh, robot, written
from PIL import Image
from PIL.PngImagePlugin import PngImageFile
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.meshes.texture import (
    BAND,
    PIXELS_CLAIMED,
    Pictures,
    compute_mean_colour,
    fit_picture,
)


def encoded(image: Image.Image, kind: str, **more: object) -> bytes:
    out = io.BytesIO()
    image.save(out, kind, **more)
    return out.getvalue()


def tiff_claiming(width: int, height: int) -> bytes:
    """A picture of so many pixels in some 200 bytes."""
    data = encoded(Image.new("LAB", (5, 3)), "TIFF")
    return data.replace(struct.pack("<HHII", 256, 4, 1, 5), struct.pack("<HHII", 256, 4, 1, width)).replace(
        struct.pack("<HHII", 257, 4, 1, 3), struct.pack("<HHII", 257, 4, 1, height)
    )


@pytest.mark.parametrize(
    "picture",
    [
        encoded(Image.new("LAB", (5, 3)), "TIFF"),
        encoded(Image.new("F", (5, 3)), "TIFF"),
        encoded(Image.new("I;16", (5, 3)), "PNG"),
        encoded(Image.new("CMYK", (5, 3)), "JPEG"),
        encoded(Image.new("P", (5, 3)), "GIF", transparency=0),
    ],
)
def test_a_picture_that_is_taken_can_be_shown(picture: bytes) -> None:
    try:
        Pictures().validate(picture)
    except ModelRefused:
        return
    assert fit_picture(picture, 128).type in ("image/png", "image/jpeg")
    assert all(0 <= part <= 1 for part in compute_mean_colour(picture))


def test_compressed_tiff_is_refused_in_one_line(capfd: pytest.CaptureFixture[str]) -> None:
    """Its decoder writes to stderr what it thinks of each of 65,535 tags."""
    with pytest.raises(ModelRefused, match="compressed TIFF"):
        Pictures().validate(encoded(Image.new("RGB", (9, 9)), "TIFF", compression="tiff_lzw"))
    assert capfd.readouterr().err == ""


def test_pixels_are_paid_for_with_bytes() -> None:
    pictures = Pictures()
    side = round((PIXELS_CLAIMED * 0.23) ** 0.5)
    claims = [tiff_claiming(side, side + i) for i in range(5)]
    for data in claims[:4]:
        with pytest.raises(ModelRefused, match="not a readable picture"):
            pictures.validate(data)  # its pixels are not there; but they have been asked for
    with pytest.raises(ModelRefused, match="left out"):
        pictures.validate(claims[4])
    assert pictures.validate(png(3000)) == png(3000)


@pytest.mark.parametrize("how", [{}, {"progressive": True}], ids=["PNG", "progressive JPEG"])
def test_a_picture_that_would_fill_the_memory_is_refused(how: dict[str, bool]) -> None:
    data = encoded(Image.new("L", (5000, 5000)), "JPEG" if how else "PNG", **how)
    with pytest.raises(
        ModelRefused, match="a picture of 5000 × 5000 pixels; at most 4096 × 4096 are supported"
    ):
        Pictures().validate(data)


LARGE = {"RGB": "PNG", "P": "PNG", "L": "JPEG"}


@pytest.mark.parametrize("mode", LARGE)
def test_a_large_picture_is_never_there_twice(mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    data = encoded(Image.new("L", (4096, 4096), 200).convert(mode), LARGE[mode])
    most = 0
    convert = Image.Image.convert

    def counted(image: Image.Image, *given: Any) -> Image.Image:
        nonlocal most
        most = max(most, image.width * image.height)
        return convert(image, *given)

    monkeypatch.setattr(Image.Image, "convert", counted)
    Pictures().validate(data)
    assert compute_mean_colour(data) == pytest.approx((200 / 255,) * 3, abs=0.01)
    assert fit_picture(data, 128).type == "image/jpeg"
    assert most <= 4096 * BAND


def test_a_picture_of_more_scans_than_pixels_are_worth() -> None:
    assert Pictures().validate(jpeg_scans(50)) == jpeg_scans(50)
    with pytest.raises(ModelRefused, match="a JPEG of more than 100 scans"):
        Pictures().validate(jpeg_scans(200))


def test_a_picture_is_looked_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looks = 0
    load = PngImageFile.load

    def counted(image: PngImageFile) -> object:
        nonlocal looks
        looks += bool(image.tile)  # what has been read has none any more
        return load(image)

    parts = []
    for i in range(6):
        (tmp_path / f"a{i}.obj").write_bytes(cube_obj(f"mtllib a.mtl\nusemtl m{i}\n"))
        parts.append(mesh(f"a{i}.obj") + mesh(f"a{i}.obj"))
    (tmp_path / "a.mtl").write_text("".join(f"newmtl m{i}\nmap_Kd a.png\n" for i in range(6)))
    (tmp_path / "a.png").write_bytes(png(200))
    path = written(tmp_path, robot(link("a", "".join(parts))))
    monkeypatch.setattr(PngImageFile, "load", counted)
    built = build_robot(path)
    assert len(built.document["visuals"]) == 12
    assert looks < 12
