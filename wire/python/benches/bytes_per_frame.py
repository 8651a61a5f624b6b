"""Bytes per frame and µs per frame on the shared telemetry sets: 30 Hz, a KEY every 4 s, deadband 0.3."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt
from posecast_wire import Decoder, Encoder, Quantiser, Schema

GOAL_MIXED_BYTES = 90.0
SETS = ("idle", "arm", "walk_synth", "mixed")
REPOSITORY = Path(__file__).resolve().parents[3]
SHARED = Path(os.environ.get("POSECAST_SHARED", REPOSITORY.parent / "shared"))


def rows(schema: Schema, path: Path) -> tuple[list[float], list[list[float]]]:
    """Times (s) and, per frame, the values of all channels in the schema's order and units."""
    with np.load(path) as data:
        ft: npt.NDArray[np.float64] = data["ft"].astype(np.float64)  # frame, site, (mx, my, fz)
        power = data["pwr"]
        frames = len(data["t"])
        fields = {
            "ftm": ft[:, :, :2].reshape(frames, -1),
            "ftf": ft[:, :, 2],
            "quat": data["imu_q"].reshape(frames, -1),
            "gyro": data["gyro"].reshape(frames, -1),
            "acc": data["acc"].reshape(frames, -1),
            "volt": power[:, :1],
            "amp": power[:, 1:],
        }
        parts = [fields[f.name] if f.name in fields else data[f.name] for f in schema.fields]
        return data["t"].tolist(), np.concatenate([p.astype(np.float64) for p in parts], axis=1).tolist()


def measure(text: str, name: str) -> float:
    """Print one line, return the mean bytes per frame."""
    schema = Schema.parse(text)
    times, values = rows(schema, SHARED / "telemetry" / f"{name}.npz")
    quantiser, encoder, decoder = Quantiser(schema), Encoder(schema), Decoder()
    decoder.add_schema(text)
    clock = time.thread_time_ns
    sizes: list[int] = []
    quantise_ns, encode_ns, decode_ns = [], [], []
    for seq, (t_s, sample) in enumerate(zip(times, values, strict=True)):
        t0 = clock()
        codes = quantiser.quantise(sample)
        t1 = clock()
        frame = encoder.encode(codes, seq, t_s, seq / 30)
        t2 = clock()
        decoded = decoder.decode(frame)
        t3 = clock()
        if list(decoded.codes) != codes:
            raise AssertionError(f"{name}: frame {seq} decodes to other codes")
        sizes.append(len(frame))
        quantise_ns.append(t1 - t0)
        encode_ns.append(t2 - t1)
        decode_ns.append(t3 - t2)
    mean = float(np.mean(sizes))
    us = "  ".join(f"{np.median(ns) / 1000:6.0f}" for ns in (quantise_ns, encode_ns, decode_ns))
    print(f"{name:<11}{mean:>8.1f}{np.percentile(sizes, 99):>6.0f}{max(sizes):>6}    {us}")
    return mean


def main() -> int:
    """Exit 1 when the mixed set costs more than the goal; 0 with a line when the data are not there."""
    path = SHARED / "telemetry" / "schema.json"
    if not path.exists():
        print("skipped: no telemetry sets beside this repository (POSECAST_SHARED names their folder)")
        return 0
    text = path.read_text(encoding="utf-8")
    print("set            mean   p99   max    µs: quantise, encode, decode (median)")
    means = {name: measure(text, name) for name in SETS}
    mixed = means["mixed"]
    print(f"mixed: {mixed:.1f} B mean, goal {GOAL_MIXED_BYTES:.0f} B")
    return 0 if mixed <= GOAL_MIXED_BYTES else 1


if __name__ == "__main__":
    sys.exit(main())
