"""Many simulated pages that watch through the proxy while something is replaced."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from posecast_testing import until
from posecast_wire.closes import Close

from tests.compose.engine import ROOT

PAGES = 12
LIVE = ("LIVE", "HOLDING")
HZ = 30  # of the robot, and of what pages ask for
STALE_FRAMES = round(1.5 * HZ)  # so many has a page missed that says STALE because of what lies between
SAME_S = 0.3  # at the same moment, more or less
AFTER_S = 2.0  # a page that is moved and not served again would be STALE after 1.5 s


@dataclass
class Watched:
    """What each page has reported and shown, filled when the watching has ended."""

    lines: dict[int, list[dict[str, Any]]] = field(default_factory=lambda: defaultdict(list))

    def list_lost_by_moves(self) -> list[dict[str, Any]]:
        """The words other than LIVE or HOLDING that pages said within AFTER_S of being moved.

        Excluded: pages that missed none of the robot's frames, because then the robot was slow.

        Excluded: words that pages that were not moved said too, because then the machine or Redis was slow.
        """
        found = []
        for lines in self.lines.values():
            for line in lines:
                is_lost = line.get("word", "LIVE") not in LIVE and self._was_moved(lines, line["at"])
                if is_lost and self._count_missed_at(lines, line["at"]) >= STALE_FRAMES:
                    stayed = [each for each in self.lines.values() if not self._was_moved(each, line["at"])]
                    if all(self._find_word(each, line["at"] + SAME_S) in LIVE for each in stayed):
                        found.append(line)
        return found

    @staticmethod
    def _was_moved(lines: list[dict[str, Any]], at_s: float) -> bool:
        moved_s = [line["at"] for line in lines if line.get("closed") == Close.DRAIN]
        return any(-SAME_S <= at_s - each_s < AFTER_S for each_s in moved_s)

    @staticmethod
    def _count_missed_at(lines: list[dict[str, Any]], at_s: float) -> float:
        before = [line["seq"] for line in lines if "seq" in line and line["at"] <= at_s]
        after = [line["seq"] for line in lines if "seq" in line and line["at"] > at_s]
        return after[0] - before[-1] if before and after else float("inf")

    @staticmethod
    def _find_word(lines: list[dict[str, Any]], at_s: float) -> str | None:
        words = [line["word"] for line in lines if "word" in line and line["at"] <= at_s]
        return words[-1] if words else None

    def measure_longest_s(self) -> float:
        """The longest time for which any page said that its picture is not live."""
        longest_s = 0.0
        for lines in self.lines.values():
            words = [line for line in lines if "word" in line]
            first = next(n for n, line in enumerate(words) if line["word"] == "LIVE")
            ends = [line["at"] for line in words[first + 1 :]] + [lines[-1]["at"]]
            for line, end_s in zip(words[first:], ends, strict=True):
                if line["word"] not in LIVE:
                    longest_s = max(longest_s, end_s - line["at"])
        return longest_s

    def count_missed(self) -> int:
        """The most consecutive robot frames that any page has missed."""
        seqs: list[list[int]] = [
            [line["seq"] for line in lines if "seq" in line] for lines in self.lines.values()
        ]
        return max(after - before for shown in seqs for before, after in pairwise(shown))

    def list_repeated(self) -> list[tuple[int, float]]:
        """Frames (number and robot's time) that a page has shown more than once, or after a newer one."""
        found = []
        for lines in self.lines.values():
            shown = [(line["seq"], line["t"]) for line in lines if "seq" in line]
            found += [after for before, after in pairwise(shown) if after <= before]
        return found

    def count_moves(self) -> int:
        """How often a page was moved away by a relay that was being replaced."""
        return sum(line.get("closed") == Close.DRAIN for lines in self.lines.values() for line in lines)


@contextmanager
def watch(cloud: Any, folder: Path) -> Iterator[Watched]:
    """Let PAGES pages watch the demo robot within the context, starting once all are LIVE."""
    url = cloud.url.replace("https", "wss") + f"/api/v1/robots/demo/live?hz={HZ}"
    out = folder / "pages.jsonl"
    env = os.environ | {"SSL_CERT_FILE": str(cloud.authority), "PYTHONPATH": str(ROOT)}
    made = Watched()
    with out.open("w") as file:
        process = subprocess.Popen(
            [sys.executable, ROOT / "tests/faults/screen.py", url, str(PAGES)], stdout=file, env=env
        )
        try:
            until("all pages are LIVE", lambda: out.read_text().count('"LIVE"') >= PAGES, 60)
            yield made
            size = out.stat().st_size
            until("they go on", lambda: out.stat().st_size > size + 30_000, 60)
        finally:
            process.terminate()
            process.wait()
    for line in out.read_text().splitlines():
        if line.endswith("}"):
            told = json.loads(line)
            made.lines[told["viewer"]].append(told)
