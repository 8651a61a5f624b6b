"""The motion as a small file; posecast_edge.sources.demo reads it.

A line `posecast-motion 1`, a line of JSON (rate, samples, fields with labels and scales, phases), then zlib
over all channels in order: int16 counts, differences from sample to sample modulo 2^16, first all low bytes
of the channel, then all high ones. -32768 is "no reading".
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Sequence

import numpy as np

from demo_robot.sensors import Field

MAGIC = b"posecast-motion 1\n"
MISSING = -32768


def pack(fields: Sequence[Field], rate_hz: int, phases: Sequence[tuple[float, str]]) -> bytes:
    """The file's bytes. ValueError when a value does not fit into int16 counts of its scale."""
    planes = []
    for field in fields:
        counts = np.round(field.values / field.scale)
        if np.nanmax(np.abs(counts)) > 32767:
            raise ValueError(f"{field.name}: {np.nanmax(np.abs(field.values)):g} does not fit its scale")
        whole = np.where(np.isnan(counts), MISSING, counts).astype(np.int64)
        step = np.diff(whole, axis=0, prepend=0).astype(np.uint16)
        for channel in step.T:
            planes += [(channel & 255).astype(np.uint8).tobytes(), (channel >> 8).astype(np.uint8).tobytes()]
    head = {
        "rate_hz": rate_hz,
        "samples": len(fields[0].values),
        "fields": [{"name": f.name, "labels": f.labels, "scale": f.scale} for f in fields],
        "phases": [list(p) for p in phases],
    }
    text = json.dumps(head, separators=(",", ":")).encode()
    return MAGIC + text + b"\n" + zlib.compress(b"".join(planes), 9)
