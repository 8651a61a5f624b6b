"""Makes pages of KEYs (SPEC §11) of kept segments, one at a time, beside the event loop."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from posecast_wire.key_page import KeyPose, encode_key_page, pick_pose

from posecast_relay.core.past.kept_segment import KeptSegment, SegmentName
from posecast_relay.core.policy.policy import Grant

POSES_BYTES = 4 << 20  # kept of what was picked already: picking one takes a tenth of a millisecond
POSE_BYTES = 500  # of Python's own for each
WAITING_MAX = 32  # pages asked for at once; further ones are refused


class KeyPages:
    """Makes pages of KEYs, and keeps some of the poses picked for them."""

    def __init__(self) -> None:
        self._worker = ThreadPoolExecutor(1, "key pages")
        self._waiting = 0
        self._poses: OrderedDict[SegmentName, KeyPose] = OrderedDict()  # the last one asked for last
        self._bytes = 0

    async def make_page(
        self, grant: Grant, from_ms: int, segments: Sequence[KeptSegment], every: int
    ) -> bytes | None:
        """Return the page of the ten minutes from `from_ms`, unix, with a pose of each `every`-th segment
        that has frames; None when WAITING_MAX pages are being made. `segments`: what the grant shows of them.
        """
        if self._waiting >= WAITING_MAX:
            return None
        with_frames = [segment for segment in segments if segment.frames]
        picked = sorted(with_frames, key=lambda segment: segment.from_ms)[::every]
        self._waiting += 1
        try:
            return await asyncio.get_running_loop().run_in_executor(
                self._worker, self._make_page, grant.robot, grant.view, from_ms, picked
            )
        finally:
            self._waiting -= 1

    def _make_page(self, robot: str, view: str, from_ms: int, segments: Sequence[KeptSegment]) -> bytes:
        poses = [pose for segment in segments if (pose := self._pick(segment)) is not None]
        return encode_key_page(robot, view, from_ms, poses)

    def _pick(self, segment: KeptSegment) -> KeyPose | None:
        pose = self._poses.get(segment.name)
        if pose is not None:
            self._poses.move_to_end(segment.name)
            return pose
        pose = pick_pose(segment.data)
        if pose is not None:
            self._poses[segment.name] = pose
            self._bytes += _size(pose)
            while self._bytes > POSES_BYTES:
                self._bytes -= _size(self._poses.popitem(last=False)[1])
        return pose


def _size(pose: KeyPose) -> int:
    return POSE_BYTES + len(pose.frame) + sum(map(len, pose.copies))
