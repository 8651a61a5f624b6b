"""What it costs to keep a robot in an object store: CPU seconds a segment, as a share of a core.

`python -m relay.benches.archive` records the demo robot as a relay does, hands each segment to the writer of
a folder, with indexes every ten minutes, and prints what writing and indexing take of a core in real time.
Exit status 1 when it is more than CORE_SHARE.
"""

from __future__ import annotations

import asyncio
import sys
import tempfile
import time
from pathlib import Path

from posecast_relay.archive.store import open_object_store
from posecast_relay.archive.upkeep import Indexer
from posecast_relay.archive.writer import ArchiveWriter
from posecast_relay.past.segment import KeptSegment

from relay.benches.past import MINUTES, record_demo

CORE_SHARE = 0.01


async def write(segments: list[KeptSegment], folder: Path) -> float:
    """Write them as they are closed, and their indexes; the CPU seconds that it takes, all threads."""
    store = open_object_store(f"file://{folder}")
    indexer = Indexer(store)
    writer = ArchiveWriter(store, indexer.mend)
    indexer.writer = writer
    writer.set_keeps({segments[0].name.robot: 1e9})
    began_s = time.process_time()
    for segment in segments:
        writer.keep(segment)
        while writer.waiting_bytes:
            await asyncio.sleep(0)
    await indexer.stop(60.0)
    took_s = time.process_time() - began_s
    assert writer.written == len(segments)
    return took_s


def main() -> int:
    """Measure, print, and judge."""
    segments = record_demo()
    with tempfile.TemporaryDirectory() as folder:
        took_s = asyncio.run(write(segments, Path(folder) / "store"))
    size = sum(each.size for each in segments)
    share = took_s / (60 * MINUTES)
    print(f"{len(segments)} segments, {size / len(segments) / 1000:.1f} kB each, in {MINUTES} min")
    print(f"{1e3 * took_s / len(segments):.2f} ms of CPU a segment: {100 * share:.3f} % of a core")
    return 0 if share <= CORE_SHARE else 1


if __name__ == "__main__":
    sys.exit(main())
