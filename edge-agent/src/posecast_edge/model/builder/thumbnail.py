"""Draws a small picture of the robot, for lists and while the model loads."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from posecast_edge.model.builder.raster import Vectors, aim_camera, draw_triangles

SIDE = 256
BYTES_MAX = 30_000
SUPERSAMPLE = 3
FRONT_LEFT_ABOVE = np.array([1.0, 0.55, 0.42])  # from the robot to the eye: x is forward, y left, z up
LIGHTS = (  # towards the light, in axes right, up, towards the eye; and how bright
    (np.array([-0.45, 0.75, 0.5]), 0.62),
    (np.array([0.7, 0.1, 0.45]), 0.22),
)
AMBIENT = 0.26


def draw_thumbnail(
    corners: Vectors, normals: Vectors, colours: Vectors, side: int = SIDE, eye: Vectors = FRONT_LEFT_ABOVE
) -> NDArray[np.uint8]:
    """Draw triangles with corners and corner normals (m, 3, 3) and display colours 0 … 1 (m, 3). Returns RGBA
    pixels (side, side, 4)."""
    pixels = side * SUPERSAMPLE
    if not len(corners):
        return np.zeros((side, side, 4), np.uint8)
    camera = aim_camera(eye, corners.reshape(-1, 3), pixels)
    triangle, weights = draw_triangles(corners, camera)
    seen = triangle >= 0
    number = triangle[seen]
    facing = np.einsum("nk,nkx->nx", weights[seen], normals[number]) @ camera.axes.T
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-9)
    facing *= np.where(facing[:, 2:] < 0, -1, 1)  # the back is lit like the front
    light = np.full(len(number), AMBIENT)
    for direction, strength in LIGHTS:
        light += strength * np.maximum(facing @ (direction / np.linalg.norm(direction)), 0)
    linear = colours[number] ** 2.2 * light[:, None]
    image = np.zeros((pixels, pixels, 4))
    image[seen, :3] = linear
    image[seen, 3] = 1
    image = image.reshape(side, SUPERSAMPLE, side, SUPERSAMPLE, 4).mean(axis=(1, 3))
    alpha = image[..., 3:]
    image[..., :3] = np.clip(image[..., :3] / np.maximum(alpha, 1e-9), 0, 1) ** (1 / 2.2)
    rounded: NDArray[np.uint8] = np.round(image * 255).astype(np.uint8)
    return rounded


def encode_png(image: NDArray[np.uint8]) -> bytes:
    """Encode a PNG of at most BYTES_MAX bytes, with fewer colours if necessary."""
    whole = Image.fromarray(image, "RGBA")
    for colours in (None, 128, 32, 8):
        reduced = whole.quantize(colours, Image.Quantize.FASTOCTREE) if colours else whole
        out = io.BytesIO()
        reduced.save(out, "PNG", optimize=True)
        if out.tell() <= BYTES_MAX:
            break
    return out.getvalue()
