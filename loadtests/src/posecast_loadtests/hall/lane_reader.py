"""One blocking viewer of the lane: requests segments over HTTP one after the other and checks each."""

from __future__ import annotations

import json
import random
import time
from collections.abc import Callable, Sequence
from http.client import HTTPConnection, HTTPException, HTTPResponse
from typing import Any
from urllib.parse import urlsplit

from posecast_wire.segment import FrameRecord, SegmentError, SegmentStart, decode_segment

from posecast_loadtests.hall.hall_counts import HallCounts
from posecast_loadtests.hall.lane_pace import LanePace

ANSWER_S = 12.0
EMPTY_S = 3.0
SPREAD_S = 2.0
FAILURES_MAX = 4
BODY_MAX = 3_000_000


class LaneReader:
    """Reads from `address` (http://…/past/VIEW). Calls `shown` for each segment with frames."""

    def __init__(self, address: str, counts: HallCounts, shown: Callable[[], None]) -> None:
        url = urlsplit(address)
        self._past, _, self._view = url.path.rpartition("/")
        self._http = HTTPConnection(url.hostname or "127.0.0.1", url.port or 80, timeout=ANSWER_S)
        self._counts = counts
        self._shown = shown
        self._pace = LanePace()
        self._wanted: tuple[str, int] | None = None  # take and index; None: the lane's first segment
        self._seen: tuple[int, int] | None = None  # run and newest seq
        self._take_seen: int | None = None
        self._failures = 0

    @property
    def due_s(self) -> float:
        """When to make the next request, in monotonic s."""
        return self._pace.due_s

    @property
    def is_over(self) -> bool:
        """Whether it gave up after too many failures."""
        return self._failures >= FAILURES_MAX

    def ask(self) -> None:
        """Make one request and wait for the response."""
        asked_s, wanted = time.monotonic(), self._wanted
        below = f"?view={self._view}" if wanted is None else f"/{self._view}/{wanted[0]}/{wanted[1]}"
        try:
            self._http.request("GET", self._past + below)
            answer = self._http.getresponse()
            body = answer.read(BODY_MAX)
        except (OSError, HTTPException):
            self._counts.away += 1
            self._fail()
            return
        self._counts.requests += 1
        if answer.status == 204 and wanted is not None:
            self._failures = 0
            retry_s = int(answer.headers.get("retry-ms", "0")) / 1000
            self._pace.take_not_yet(retry_s, time.monotonic())
        elif answer.status != 200:
            self._refuse(answer)
        elif wanted is None:
            self._begin(json.loads(body))
        elif answer.headers.get("content-type") == "application/json":
            self._failures = 0
            self._wanted = _name(json.loads(body)["next"])
        else:
            self._take(body, asked_s)

    def _begin(self, said: dict[str, Any]) -> None:
        self._failures = 0
        if said["newest"] is None:
            self._pace.wait(EMPTY_S * random.uniform(0.5, 1.5), time.monotonic())
        else:
            self._wanted = _name(said["newest"])

    def _take(self, body: bytes, asked_s: float) -> None:
        assert self._wanted is not None
        take, index = self._wanted
        try:
            segment = decode_segment(body)
        except SegmentError:
            segment = None
        start = None if segment is None else segment.start
        if segment is None or start is None or (f"{start.take:016x}", start.index) != self._wanted:
            self._counts.unreadable += 1
            self._fail()
            return
        self._failures = 0
        self._wanted = take, index + 1
        self._pace.take_segment(start.from_ms / 1000, segment.to_ms / 1000, asked_s, time.monotonic())
        if segment.frames:
            self._check(start, segment.frames)
            self._shown()
        self._counts.segments += 1

    def _check(self, start: SegmentStart, frames: Sequence[FrameRecord]) -> None:
        """Check that no frame of a run repeats and none is missing in a take."""
        if self._seen is not None and self._seen[0] == start.run_id:
            step = frames[0].seq - self._seen[1]
            self._counts.repeats += step <= 0
            self._counts.missed += max(0, step - 1) if self._take_seen == start.take else 0
        self._seen, self._take_seen = (start.run_id, frames[-1].seq), start.take

    def _refuse(self, answer: HTTPResponse) -> None:
        if answer.status == 404:  # the name is from the old relay: restart at the lane's first segment
            self._counts.begun_anew += 1
        else:
            self._counts.note_refusal(f"lane: {answer.status} {answer.reason}")
        self._fail()

    def _fail(self) -> None:
        self._http.close()
        self._wanted = None
        self._pace.wait(random.uniform(0.0, SPREAD_S * 2**self._failures), time.monotonic())
        self._failures += 1

    def close(self) -> None:
        """Close the connection. Calling it twice is fine."""
        self._http.close()


def _name(said: dict[str, Any]) -> tuple[str, int]:
    return said["take"], said["index"]
