"""Writes binary glTF 2.0 files (GLB), packed (EXT_meshopt_compression) if meshoptimizer is installed. The
same input gives the same bytes."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.builder.mesh_coder import can_pack, pack_attributes, pack_indices

FLOAT, BYTE, SHORT, UINT = 5126, 5120, 5122, 5125
PACKING = ("EXT_meshopt_compression",) if can_pack() else ()


class GlbWriter:
    """Collects buffer views; `document` is the rest of the glTF JSON."""

    def __init__(self) -> None:
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "posecast-edge"},
            "extensionsUsed": [*PACKING, "KHR_mesh_quantization"],
            "extensionsRequired": [*PACKING, "KHR_mesh_quantization"],
        }
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._binary = bytearray()
        self._plain = 0  # bytes that the compressed views have when unpacked

    def add_raw_view(self, data: bytes) -> int:
        """Add an uncompressed view, for pictures, and return its number."""
        offset = self._append(data)
        self._views.append({"buffer": 0, "byteOffset": offset, "byteLength": len(data)})
        return len(self._views) - 1

    def add_attribute_view(self, values: NDArray[Any]) -> int:
        """Add a view of values (n, k), packed where possible, and return its number. A row must be a multiple
        of 4 bytes."""
        if not PACKING:
            number = self.add_raw_view(values.tobytes())
            self._views[number]["byteStride"] = values.strides[0]
            return number
        return self._compressed(pack_attributes(values), len(values), values.strides[0], "ATTRIBUTES")

    def add_index_view(self, indices: NDArray[np.uint32], vertices: int) -> int:
        """Add a view of triangle indices, packed where possible, and return its number."""
        if not PACKING:
            return self.add_raw_view(indices.astype("<u4").tobytes())
        return self._compressed(pack_indices(indices, vertices), len(indices), 4, "TRIANGLES")

    def add_accessor(self, view: int, component: int, kind: str, count: int, more: Mapping[str, Any]) -> int:
        """Add an accessor of a view and return its number."""
        self._accessors.append(
            {"bufferView": view, "componentType": component, "type": kind, "count": count, **more}
        )
        return len(self._accessors) - 1

    def _compressed(self, data: bytes, count: int, stride: int, mode: str) -> int:
        offset = self._append(data)
        view: dict[str, Any] = {"buffer": 1, "byteOffset": self._plain, "byteLength": count * stride}
        if mode == "ATTRIBUTES":
            view["byteStride"] = stride
        how = {"buffer": 0, "byteOffset": offset, "byteLength": len(data)}
        view["extensions"] = {
            "EXT_meshopt_compression": {**how, "byteStride": stride, "count": count, "mode": mode}
        }
        self._plain += -(-count * stride // 4) * 4
        self._views.append(view)
        return len(self._views) - 1

    def _append(self, data: bytes) -> int:
        offset = len(self._binary)
        self._binary += data + b"\0" * (-len(data) % 4)
        return offset

    def encode(self) -> bytes:
        """The whole GLB file."""
        fallback = {"byteLength": self._plain, "extensions": {"EXT_meshopt_compression": {"fallback": True}}}
        document = {
            **self.document,
            "buffers": [{"byteLength": len(self._binary)}, *([fallback] if PACKING else [])],
            "bufferViews": self._views,
            "accessors": self._accessors,
        }
        text = json.dumps(document, separators=(",", ":"), ensure_ascii=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self._binary), b"BIN\0") + bytes(self._binary)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
