"""Draws a small picture of the robot, for lists and while the model loads."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

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


# --- triangles

Vectors = NDArray[np.float64]
TESTS_MAX = 4_000_000  # pixel tests at a time, which limits the memory
TESTS_IN_ALL = 1 << 26  # of one picture: a second or two


@dataclass(frozen=True)
class Camera:
    """An orthographic camera. `axes`: right, up and towards the eye; `centre`: the point in the middle of the
    picture; `span`: metres along the picture's side."""

    axes: Vectors
    centre: Vectors
    span: float
    pixels: int

    def project(self, points: Vectors) -> Vectors:
        """Convert points (…, 3) in metres to pixels right, pixels down, and metres away from the eye."""
        seen = (points - self.centre) @ self.axes.T
        scale = self.pixels / self.span
        middle = self.pixels / 2
        return np.stack(
            [seen[..., 0] * scale + middle, middle - seen[..., 1] * scale, -seen[..., 2]], axis=-1
        )


def aim_camera(direction: Vectors, points: Vectors, pixels: int, margin: float = 1.06) -> Camera:
    """A camera that sees all points, placed in `direction` from them, with world z up. `margin` scales the
    visible span."""
    forward = direction / np.linalg.norm(direction)
    up = np.array([0.0, 0.0, 1.0]) if abs(forward[2]) < 0.99 else np.array([1.0, 0.0, 0.0])
    right = np.cross(up, forward)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(forward, right), forward])
    seen = points @ axes.T
    low, high = seen.min(0), seen.max(0)
    span = max(float((high - low)[:2].max()) * margin, 1e-9)
    return Camera(axes, (low + high) / 2 @ axes, span, pixels)


def draw_triangles(corners: Vectors, camera: Camera) -> tuple[NDArray[np.int64], Vectors]:
    """Draw triangles with corners (m, 3, 3) in metres: for thumbnails, and to compare silhouettes. Both sides
    are visible. Returns, for each pixel, the number of the visible triangle (pixels, pixels), -1 for none,
    and the barycentric weights of its corners (pixels, pixels, 3).

    Triangles are sorted into classes by the size of their box on the screen; a class is tested against all
    pixels of such a box at once, so a million small triangles cost no loop.
    """
    side = camera.pixels
    screen = camera.project(corners)
    depth = screen[..., 2]
    low, high = (float(depth.min()), float(depth.max())) if len(depth) else (0.0, 1.0)
    steps = (depth - low) / max(high - low, 1e-12) * (2**31 - 1)
    nearest = np.full(side * side, np.iinfo(np.int64).max)
    a, b, c = screen[:, 0, :2], screen[:, 1, :2], screen[:, 2, :2]
    sizes = np.ceil(np.maximum(np.maximum(a, b), c)) - np.floor(np.minimum(np.minimum(a, b), c))
    powers = np.ceil(np.log2(np.maximum(sizes, 1))).astype(np.int64)
    classes = np.where(_affordable(powers.sum(axis=1)), powers[:, 0] * 64 + powers[:, 1], -1)
    for box in np.unique(classes[classes >= 0]):
        width, height = divmod(int(box), 64)
        chosen = np.flatnonzero(classes == box)
        tests = len(chosen) << (width + height)
        for chunk in np.array_split(chosen, tests // TESTS_MAX + 1):
            _test(screen[chunk, :, :2], steps[chunk], chunk, (1 << width, 1 << height), side, nearest)
    seen = nearest != np.iinfo(np.int64).max
    triangle = np.where(seen, nearest & 0xFFFFFFFF, -1).reshape(side, side)
    return triangle, _weights(screen, triangle, side)


def _affordable(powers: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which triangles are drawn, by the power of two of their pixel tests: the smaller ones first, as many as
    TESTS_IN_ALL allows. A robot needs a tenth of that; a hostile mesh of huge triangles could need far more.
    """
    order = np.argsort(powers, kind="stable")
    drawn = np.zeros(len(powers), bool)
    drawn[order] = np.cumsum(np.exp2(powers[order])) <= TESTS_IN_ALL
    return drawn


def _test(
    xy: Vectors,
    steps: Vectors,
    numbers: NDArray[np.int64],
    size: tuple[int, int],
    side: int,
    nearest: NDArray[np.int64],
) -> None:
    """Write the triangles into `nearest`, whose entries are (depth << 32) | number."""
    corner = np.floor(np.minimum(np.minimum(xy[:, 0], xy[:, 1]), xy[:, 2])).astype(np.int64)
    x = corner[:, 0, None] + np.arange(size[0]) + 0.5 - xy[:, 0, 0, None]  # (m, width), from the first corner
    y = corner[:, 1, None] + np.arange(size[1]) + 0.5 - xy[:, 0, 1, None]
    u, v = xy[:, 1] - xy[:, 0], xy[:, 2] - xy[:, 0]
    area = _cross(u, v)
    area = np.where(area == 0, np.nan, area)[:, None]  # never inside
    b = ((-v[:, 0, None] * y) / area)[:, :, None] + ((v[:, 1, None] * x) / area)[
        :, None, :
    ]  # (m, height, width)
    c = ((u[:, 0, None] * y) / area)[:, :, None] - ((u[:, 1, None] * x) / area)[:, None, :]
    which, row, column = np.nonzero((b >= 0) & (c >= 0) & (b + c <= 1))
    b, c = b[which, row, column], c[which, row, column]
    row, column = row + corner[which, 1], column + corner[which, 0]
    shown = (row >= 0) & (row < side) & (column >= 0) & (column < side)
    which, row, column, b, c = (values[shown] for values in (which, row, column, b, c))
    at = steps[which]
    depth = np.clip(at[:, 0] * (1 - b - c) + at[:, 1] * b + at[:, 2] * c, 0, 2**31 - 1).astype(np.int64)
    np.minimum.at(nearest, row * side + column, (depth << 32) | numbers[which])


def _cross(u: Vectors, v: Vectors) -> Vectors:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def _weights(screen: Vectors, triangle: NDArray[np.int64], side: int) -> Vectors:
    weights = np.zeros((side, side, 3))
    rows, columns = np.nonzero(triangle >= 0)
    points: Vectors = np.stack([columns, rows], axis=1) + np.float64(0.5)
    p, q, r = (screen[triangle[rows, columns], k, :2] for k in range(3))
    area = _cross(q - p, r - p)
    b, c = _cross(points - p, r - p) / area, _cross(q - p, points - p) / area
    weights[rows, columns] = np.stack([1 - b - c, b, c], axis=1)
    return weights
