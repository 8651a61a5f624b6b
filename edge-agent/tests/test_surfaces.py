"""Welding, normals, simplification, packing and drawing: the geometry between a mesh and a level."""

from __future__ import annotations

import io
import zlib
from dataclasses import replace

import numpy as np
import pytest
from model_stage import CUBE_CORNERS, CUBE_FACES, cube_stl
from PIL import Image
from posecast_edge.model.builder.mesh_coder import (
    FINEST,
    LARGEST,
    STEP,
    LodChain,
    count_rungs,
    drop_duplicate_faces,
    drop_unused_vertices,
    weld_vertices,
)
from posecast_edge.model.builder.quantise import compute_crease_normals, make_grid, pack_part
from posecast_edge.model.builder.thumbnail import aim_camera, draw_thumbnail, draw_triangles, encode_png
from posecast_edge.model.meshes.mesh import Surface
from posecast_edge.model.meshes.primitives import tessellate
from posecast_edge.model.meshes.reader import read_stl
from posecast_edge.model.meshes.texture import compute_mean_colour, fit_picture

RUNGS = count_rungs([2.0], 2.0)
CUBE = Surface(CUBE_CORNERS, CUBE_FACES.astype(np.int32))


def ball(radius: float = 1.0) -> Surface:
    return weld_vertices(replace(tessellate("sphere", (radius,)).surfaces[0], uv=None))


def test_weld_makes_one_body_of_loose_triangles() -> None:
    [loose] = read_stl(cube_stl()).surfaces
    assert len(loose.positions) == 36
    welded = weld_vertices(loose)
    assert len(welded.positions) == 8
    assert len(welded.faces) == 12


def test_weld_drops_what_has_no_area_or_stands_twice() -> None:
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1e-9]], np.float32)
    faces = np.array([[0, 1, 2], [1, 2, 0], [0, 2, 1], [0, 3, 1]], np.int32)
    assert weld_vertices(Surface(positions, faces)).faces.shape == (
        2,
        3,
    )  # the second is the first; the third its back


def test_unique_faces_of_many_vertices() -> None:
    faces = np.array([[0, 1, 3_000_000], [1, 3_000_000, 0], [5, 5, 6]])
    assert drop_duplicate_faces(faces, 3_000_001).tolist() == [[0, 1, 3_000_000]]


def test_used_only_counts_in_the_order_of_use() -> None:
    used, faces = drop_unused_vertices(np.array([[7, 2, 5], [5, 2, 9]], np.int32))
    assert used.tolist() == [7, 2, 5, 9]
    assert faces.tolist() == [[0, 1, 2], [2, 1, 3]]


def test_a_cube_has_edges_and_a_ball_has_none() -> None:
    group, normals = compute_crease_normals(CUBE.positions, CUBE.faces, 40)
    assert len(normals) == 24
    assert np.allclose(np.abs(normals).max(axis=1), 1)
    assert len(group) == 36
    round_ = ball()
    group, normals = compute_crease_normals(round_.positions, round_.faces, 40)
    assert len(normals) == len(round_.positions)
    outward = round_.positions[round_.faces.reshape(-1)]
    assert (np.einsum("nk,nk->n", normals[group], outward) > 0.99).all()


def test_a_ladder_stays_within_its_bounds() -> None:
    surface = ball()
    ladder = LodChain(surface, mesh_size=2.0, robot_size=2.0, rungs=RUNGS)
    last = len(surface.faces) + 1
    for step in range(0, RUNGS, 3):
        bound, faces = ladder.get_rung(step)
        assert bound == pytest.approx(min(2.0 * FINEST * STEP**step, 2.0 * LARGEST))
        assert len(faces) <= last
        last = len(faces)
        middles = surface.positions[faces].astype(np.float64).mean(axis=1)
        moved = np.abs(np.linalg.norm(middles, axis=1) - 1).max()
        assert moved < 3 * bound + 0.01  # 0.01: the tessellation itself
    assert 50 < last < len(surface.faces) / 4
    assert ladder.get_rung(RUNGS - 1)[0] == pytest.approx(2.0 * LARGEST)


def test_behind_the_last_rung_surfaces_move_further() -> None:
    ladder = LodChain(ball(), mesh_size=2.0, robot_size=2.0, rungs=RUNGS)
    bounds, faces = zip(*(ladder.get_rung(RUNGS - 1 + more) for more in (0, 1, 2)), strict=True)
    assert bounds == pytest.approx([2.0 * LARGEST * STEP**more for more in (0, 1, 2)])
    assert len(faces[2]) < len(faces[1]) < len(faces[0])


def test_what_would_vanish_behind_the_last_rung_stays_as_it_was_before() -> None:
    """Cubes apart from each other, of 4 % of the whole."""
    places = np.stack(np.meshgrid(*[np.linspace(-1, 1, 4)] * 3), -1).reshape(-1, 1, 3)
    cubes = (0.08 * CUBE_CORNERS / np.ptp(CUBE_CORNERS) + places).reshape(-1, 3).astype(np.float32)
    faces = (CUBE_FACES + 8 * np.arange(len(places))[:, None, None]).reshape(-1, 3).astype(np.int32)
    ladder = LodChain(Surface(cubes, faces), 2.0, 2.0, RUNGS)
    whole, fewer, last = (len(ladder.get_rung(RUNGS - 1 + more)[1]) for more in (0, 1, 2))
    assert whole == 64 * 12
    assert 0 < last == fewer < whole / 2


def test_small_surfaces_are_left_alone() -> None:
    triangle = Surface(CUBE_CORNERS[:3], np.array([[0, 1, 2]], np.int32))
    assert LodChain(triangle, 1.0, 1.0, RUNGS).get_rung(30)[1].tolist() == [[0, 1, 2]]


def test_packing_is_exact_to_half_a_step() -> None:
    surface = ball(0.3)
    low, high = surface.positions.min(0), surface.positions.max(0)
    for bits in (12, 14, 16):
        grid = make_grid(low, high, bits)
        part = pack_part(surface, surface.faces, grid)
        assert np.abs(part.positions).max() == (1 << (bits - 1)) - 1
        metres = grid.to_metres(part.positions)[part.faces].reshape(-1, 3)
        for k in range(3):
            assert metres[:, k].min() == pytest.approx(low[k], abs=grid.step)
            assert metres[:, k].max() == pytest.approx(high[k], abs=grid.step)
    assert len(part.faces) == len(surface.faces)
    assert (part.positions[:, 3] == 0).all()


def test_packing_what_is_smaller_than_the_grid() -> None:
    speck = Surface(CUBE_CORNERS * np.float32(1e-6), CUBE.faces)
    grid = make_grid(np.zeros(3, np.float32), np.ones(3, np.float32), 12)
    assert len(pack_part(speck, speck.faces, grid).faces) == 0


def test_a_cube_seen_from_the_front() -> None:
    corners = CUBE.positions[CUBE.faces].astype(np.float64)
    camera = aim_camera(np.array([1.0, 0, 0]), corners.reshape(-1, 3), 100, margin=2.0)
    triangle, weights = draw_triangles(corners, camera)
    seen = triangle >= 0
    assert seen.sum() == 50 * 50
    assert seen[25:75, 25:75].all()
    assert set(np.unique(triangle[seen])) == {2, 3}  # the two of the face x = 1
    assert np.allclose(weights[seen].sum(1), 1)
    assert (weights[seen] > -1e-9).all()
    assert ((draw_triangles(corners, camera)[0] >= 0) == seen).all()


def test_nothing_to_draw() -> None:
    empty = np.zeros((0, 3, 3))
    assert draw_thumbnail(empty, empty, np.zeros((0, 3))).max() == 0


def test_a_thumbnail_is_small_whatever_it_shows() -> None:
    noise = np.random.default_rng(1).integers(0, 255, (256, 256, 4)).astype(np.uint8)
    data = encode_png(noise)
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert len(data) <= 30_000
    assert len(zlib.compress(data)) > 5_000


def test_pictures_are_fitted() -> None:
    def encoded(image: Image.Image, kind: str) -> bytes:
        out = io.BytesIO()
        image.save(out, kind)
        return out.getvalue()

    small = encoded(Image.new("RGB", (8, 4), (255, 0, 0)), "PNG")
    assert fit_picture(small, 8).data is small
    assert compute_mean_colour(small) == (1, 0, 0)
    shrunk = fit_picture(encoded(Image.new("RGB", (100, 50), (0, 255, 0)), "BMP"), 20)
    assert shrunk.type == "image/jpeg"
    with Image.open(io.BytesIO(shrunk.data)) as image:
        assert image.size == (20, 10)
    clear = fit_picture(encoded(Image.new("RGBA", (100, 50), (0, 255, 0, 10)), "PNG"), 20)
    assert clear.type == "image/png"
