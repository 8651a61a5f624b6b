"""What a lecture costs on a static host: 50 minutes of the mixed telemetry set with a model of 2 MB."""

from __future__ import annotations

import os
import random
from pathlib import Path

import numpy as np
import pytest
from posecast_relay.recording.page import add_page
from posecast_wire import Quantiser, Schema

from wire.python.benches.bytes_per_frame import SHARED, rows

from .recording_stage import KeptModel, KeptSource, collect, list_files
from .taped_world import TapedWorld, on_air

REPOSITORY = Path(__file__).resolve().parents[2]
PAGE = Path(os.environ.get("POSECAST_PAGE", REPOSITORY / "spa/dist"))
HZ, MINUTES = 30, 50
KEY_EVERY = 4 * HZ
MODEL_BYTES = 2_000_000
ALLOWED_BYTES = 12_000_000


@pytest.mark.full
@pytest.mark.skipif(not (SHARED / "telemetry").exists(), reason="no telemetry sets beside the repository")
@pytest.mark.skipif(not (PAGE / "index.html").exists(), reason="no built page: run make setup")
def test_fifty_minutes_fit_into_twelve_megabytes(tmp_path: Path) -> None:
    schema = Schema.parse((SHARED / "telemetry/schema.json").read_text())
    _, values = rows(schema, SHARED / "telemetry/mixed.npz")
    quantiser = Quantiser(schema)
    codes = [quantiser.quantise(sample) for sample in values]
    model = KeptModel({"high.glb": (random.Random(1).randbytes(MODEL_BYTES), "model/gltf-binary")})
    world = TapedWorld()
    edge = on_air(world, schema)
    world.hear_event(edge, type="model", hash=model.name)
    for n in range(HZ * 60 * MINUTES):
        world.pass_time(1 / HZ)
        world.hear(edge, edge.frame(world.now, codes[n % len(codes)], force_key=n % KEY_EVERY == 0))
    recording, found = collect(KeptSource(world.close(), [model]), tmp_path / "lecture", packs=True)
    assert found.lost == []
    add_page(PAGE, tmp_path / "lecture", recording, None)
    sizes = {path: (tmp_path / "lecture" / path).stat().st_size for path in list_files(tmp_path / "lecture")}
    sums = {
        part: sum(size for path, size in sizes.items() if path.startswith(part))
        for part in ("segments", "keys", "models", "recording.json", "")
    }
    frames = sum(each.frames for each in recording.segments)
    print(f"{frames} frames, {len(recording.segments)} segments:", sums)
    assert frames >= HZ * 60 * MINUTES
    assert np.mean([each.frames for each in recording.segments[1:-1]]) == KEY_EVERY
    assert sums[""] <= ALLOWED_BYTES
