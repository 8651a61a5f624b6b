"""Draws the poster of a moment, which the page shows until somebody plays it: the body as it was recorded."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable

import numpy as np
from PIL import Image
from posecast_edge.model.builder.thumbnail import draw_thumbnail
from posecast_edge.model.kinematics import compute_link_poses, matrix_from_quaternion
from posecast_edge.model.serve.bundle import Bundle
from posecast_relay.export.link_poses import FrameReadings
from posecast_relay.past.segment import KeptSegment
from posecast_wire import Decoder
from posecast_wire.segment import CopyRecord, FrameRecord, decode_segment

from tools.gallery.picture import Vectors, read_triangles

SIDE = 420  # pixels
QUALITY = 80


def draw_poster(bundle: Bundle, segments: Iterable[KeptSegment], at_ms: int, eye: Vectors) -> bytes:
    """A WebP of the body at a moment (unix ms), with nothing behind it. `eye`: from the body to the camera,
    in the world."""
    readings = read_frames(segments, at_ms)
    manifest = json.loads(bundle.manifest)
    level = manifest["levels"][-1]["path"]
    glb = next(file.source for file in bundle.files if file.path == level).read_bytes()
    corners, normals, colours = read_triangles(manifest, glb, compute_link_poses(manifest, readings.joints))
    w, x, y, z = (1.0, 0.0, 0.0, 0.0) if readings.base is None else readings.base.quat
    world_from_root = np.array(matrix_from_quaternion((0, 0, 0), (w, x, y, z)))[:3, :3]
    pixels = draw_thumbnail(corners @ world_from_root.T, normals @ world_from_root.T, colours, SIDE, eye)
    out = io.BytesIO()
    Image.fromarray(pixels, "RGBA").save(out, "WEBP", quality=QUALITY)
    return out.getvalue()


def read_frames(segments: Iterable[KeptSegment], until_ms: int) -> FrameReadings:
    """What a robot's frames say of its body, up to a moment (unix ms)."""
    decoder, readings = Decoder(), None
    for kept in segments:
        segment = decode_segment(kept.data)
        schema = decoder.add_schema(kept.schema_text or "")
        readings = readings or FrameReadings(schema)
        for record in segment.records:
            if isinstance(record, CopyRecord):
                decoder.decode(record.frame)
            elif isinstance(record, FrameRecord):
                if segment.start.from_ms + record.at_us / 1000 > until_ms:
                    return readings
                readings.take(decoder.decode(record.frame).codes)
    assert readings is not None  # a recording has segments
    return readings
