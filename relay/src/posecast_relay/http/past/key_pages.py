"""Makes pages of KEYs (SPEC §11) from kept segments, one at a time, off the event loop."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

from posecast_wire.key_page import KeyPose, encode_key_page, pick_pose

from posecast_relay.core.past.kept_segment import KeptSegment, SegmentName
from posecast_relay.core.policy import Grant

POSES_BYTES = 4 << 20  # cached poses: picking one takes a tenth of a millisecond
POSE_BYTES = 500  # Python's overhead for each
WAITING_MAX = 32  # concurrent requests for pages; any more are refused
LOADED_BYTES = 1 << 20  # of stored segments loaded at a time, except for a single one
LOADED_BYTES_MAX = 16 << 20  # of them for one page; a page that needs more has fewer poses

Load = Callable[[Sequence[KeptSegment]], Awaitable[list[KeptSegment]]]


class KeyPages:
    """Makes pages of KEYs and caches some of the poses picked for them."""

    def __init__(self) -> None:
        self._worker = ThreadPoolExecutor(1, "key pages")
        self._waiting = 0
        self._poses: OrderedDict[SegmentName, KeyPose] = OrderedDict()  # most recently used last
        self._bytes = 0

    async def make_page(
        self, grant: Grant, from_ms: int, segments: Sequence[KeptSegment], every: int, load: Load
    ) -> bytes | None:
        """Return the page of the ten minutes from `from_ms`, unix ms, with a pose from every `every`-th
        segment that has frames.

        None if WAITING_MAX pages are already being made. `segments`: those that the grant may see; `load`
        returns them with their bytes, without those that are gone.
        """
        if self._waiting >= WAITING_MAX:
            return None
        with_frames = sorted((each for each in segments if each.frames), key=lambda each: each.from_ms)
        while len(with_frames[::every]) > 1 and self._sum_lacking(with_frames[::every]) > LOADED_BYTES_MAX:
            every *= 2
        loop = asyncio.get_running_loop()
        poses: list[KeyPose] = []
        self._waiting += 1
        try:
            for part in self._divide(with_frames[::every]):
                whole = await load(part) if self._sum_lacking(part) else part
                poses += await loop.run_in_executor(self._worker, self._pick_all, whole)
            return await loop.run_in_executor(
                self._worker, encode_key_page, grant.robot, grant.view, from_ms, poses
            )
        finally:
            self._waiting -= 1

    def forget(self, robot: str) -> None:
        """Forget the poses of a robot because part of its past was deleted."""
        for name in [name for name in self._poses if name.robot == robot]:
            pose = self._poses.pop(name, None)  # the worker may have removed it first
            self._bytes -= 0 if pose is None else _size(pose)

    def _divide(self, segments: Sequence[KeptSegment]) -> list[list[KeptSegment]]:
        """Divide them into parts that can be loaded at a time."""
        parts: list[list[KeptSegment]] = [[]]
        size = 0
        for segment in segments:
            size += (more := self._sum_lacking([segment]))
            if size > LOADED_BYTES and parts[-1]:
                parts.append([])
                size = more
            parts[-1].append(segment)
        return parts

    def _sum_lacking(self, segments: Sequence[KeptSegment]) -> int:
        """Return how many bytes must be loaded because their pose is not cached."""
        return sum(each.elsewhere_bytes for each in segments if each.name not in self._poses)

    def _pick_all(self, segments: Sequence[KeptSegment]) -> list[KeyPose]:
        return [pose for segment in segments if (pose := self._pick(segment)) is not None]

    def _pick(self, segment: KeptSegment) -> KeyPose | None:
        pose = self._poses.get(segment.name)
        if pose is not None:
            self._poses.move_to_end(segment.name)
            return pose
        pose = pick_pose(segment.data) if segment.data else None  # otherwise its pose was cached a moment ago
        if pose is not None:
            self._poses[segment.name] = pose
            self._bytes += _size(pose)
            while self._bytes > POSES_BYTES:
                self._bytes -= _size(self._poses.popitem(last=False)[1])
        return pose


def _size(pose: KeyPose) -> int:
    return POSE_BYTES + len(pose.frame) + sum(map(len, pose.copies))
