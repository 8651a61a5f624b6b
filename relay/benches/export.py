"""What an export costs: CPU time, bytes and memory for some minutes of the demo robot, as CSV and as MCAP.

`python -m relay.benches.export [MINUTES]` plays the demo's minute so many times, each as a run of its own,
and writes to nowhere. Exit status 1 when memory grows with length by more than GROWTH_MB.
"""

from __future__ import annotations

import io
import resource
import sys
import time
from collections.abc import Iterator

from posecast_edge.profile.reader import load_profile
from posecast_edge.profile.schema import make_schema_text
from posecast_edge.sources.demo import BUNDLE, PROFILE, read_motion
from posecast_relay.export.csv_file import write_csv
from posecast_relay.export.mcap_file import write_mcap
from posecast_relay.export.table import TableReader
from posecast_wire import Encoder, Quantiser, Schema

from relay.tests.export_stage import FROM_MS, Named, Nowhere, Take, hash_of, schemas_of

HZ = 30
MINUTE = 60 * HZ  # frames
GROWTH_MB = 2.0


def make_frames(schema: Schema) -> list[bytes]:
    """A minute of the demo robot, as an agent encodes it."""
    motion = read_motion((BUNDLE / "motion.bin").read_bytes())
    quantiser, encoder = Quantiser(schema), Encoder(schema, 4.0)
    frames: list[bytes] = []
    for i in range(MINUTE):
        values = motion.make_sample(round(i / HZ * motion.rate_hz)).values
        said = [v for f in schema.fields for v in (values.get(f.name) or [None] * f.size)]
        frames.append(encoder.encode(quantiser.quantise(said), i, i / HZ, i / HZ))  # type: ignore[arg-type]
    return frames


def make_segments(text: str, model: str, frames: list[bytes], minutes: int) -> Iterator[Named]:
    """Segments of 4 s, made as they are asked for."""
    for minute in range(minutes):
        from_ms = FROM_MS + 60_000 * minute
        take = Take(text, minute, minute + 1, from_ms, 1_000_000 // HZ, model, 4 * HZ)
        yield from take.record(frames)


def find_peak_mb() -> float:
    """The most memory that this process has had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    """Print a line for each format."""
    minutes = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    text = make_schema_text(load_profile(PROFILE))
    manifest = (BUNDLE / "model" / "manifest.json").read_bytes()
    model, frames = hash_of(manifest), make_frames(Schema.parse(text))
    worst_mb = 0.0
    for kind in ("csv", "mcap"):
        for length in (1, minutes):
            file = Nowhere()
            table = TableReader(make_segments(text, model, frames, length), schemas_of(text))
            before_mb, began_s = find_peak_mb(), time.process_time()
            with io.BufferedWriter(file) as out:
                count = (
                    write_csv(out, table) if kind == "csv" else write_mcap(out, table, {model: manifest}.get)
                )
            took_s, grown_mb = time.process_time() - began_s, find_peak_mb() - before_mb
            print(
                f"{kind:4} {length:3} min: {count:,} frames, {file.size / 1e6:.1f} MB, {took_s:.1f} s CPU, "
                f"{1e6 * took_s / count:.0f} µs a frame, peak +{grown_mb:.1f} MB"
            )
        worst_mb = max(worst_mb, grown_mb)
    sys.exit(worst_mb > GROWTH_MB)


if __name__ == "__main__":
    main()
