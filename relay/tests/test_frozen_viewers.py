"""Viewers whose process stands still: they hurt nobody, and what they are handed afterwards is new."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import free_port, until
from posecast_wire import Close

from .stage import Watcher
from .test_observability import figures

HZ = 30
PAGE = """
import json, sys, time
from websockets.sync.client import connect
from posecast_wire import Decoder
decoder, n, acked = Decoder(), 0, 0.0
with connect(sys.argv[1]) as link:
    for message in link:
        if isinstance(message, str):
            if json.loads(message)["type"] == "schema":
                decoder.add_schema(message)
            continue
        n += 1
        print(decoder.decode(message).seq, flush=True)
        if time.monotonic() - acked >= 1:
            acked = time.monotonic()
            link.send(json.dumps({"type": "ack", "n": n}))
"""


class Page:
    """A viewer in a process of its own, which acknowledges as our page does."""

    def __init__(self, url: str, folder: Path) -> None:
        self._shown = folder / f"page-{time.monotonic_ns()}"
        with self._shown.open("wb") as out:
            self.process = subprocess.Popen(
                [sys.executable, "-c", PAGE, url], stdout=out, stderr=subprocess.DEVNULL
            )

    def seqs(self) -> list[int]:
        """The frames it has shown."""
        return [int(line) for line in self._shown.read_text().splitlines()]


@pytest.fixture
def pages(tmp_path: Path) -> Iterator[Any]:
    """Starts some; all end."""
    started: list[Page] = []

    def start(url: str) -> Page:
        started.append(Page(url, tmp_path))
        return started[-1]

    yield start
    for page in started:
        page.process.kill()
        page.process.wait()


@pytest.mark.full
async def test_one_frozen_for_ten_seconds_sees_two_old_ones_at_most_and_one_for_good_is_cut(
    relays: Any, edges: Any, pages: Any
) -> None:
    port = free_port()
    relay = relays("--metrics-port", str(port))
    edge = edges(relay.zenoh)
    resumed, lost = pages(relay.url()), pages(relay.url())
    async with Watcher(relay.url()) as healthy:
        await healthy.until("frames", lambda v: len(v.frames) > 10)
        for page in (resumed, lost):
            await asyncio.to_thread(until, "frames", lambda p=page: len(p.seqs()) > 3 * HZ)
        frozen = healthy.frames[-1][1].seq
        for page in (resumed, lost):
            page.process.send_signal(signal.SIGSTOP)
        await healthy.until("ten seconds", lambda _: edge.seq >= frozen + 10 * HZ, 20.0)
        thawed = edge.seq
        resumed.process.send_signal(signal.SIGCONT)
        await asyncio.to_thread(until, "the newest", lambda: resumed.seqs()[-1] >= thawed)
        seqs = resumed.seqs()
        assert seqs == sorted(set(seqs))
        old = [seq for seq in seqs if frozen < seq < thawed - 1]
        assert len(old) <= 2.2 * HZ  # two seconds' worth, and what was under way
        assert max(old, default=0) <= frozen + 2.5 * HZ
        # it answers no ping either, which shows sooner than the missing acknowledgements
        cut = f"posecast_endings_total|{int(Close.HALF_OPEN)}"
        await asyncio.to_thread(until, "the other is cut", lambda: figures(port).get(cut) == 1, 20.0)
        assert healthy.closed is None
        assert healthy.most_missed(frozen) < HZ
        assert (await asyncio.to_thread(figures, port))["posecast_viewers"] == 2
