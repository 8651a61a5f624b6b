"""Works out what to write so that a mirror of the public views holds the newest state.

Each robot has one node with these children:

    schema, key, frame   as the edge sent them, in base64
    status               {robot, age_ms, seq, at, model}, as sent to viewers. `at` is the relay's unix clock
                         in ms. It differs with every write, so readers can tell that the relay still writes

There is no queue. Each call of `find_changes` compares the current state with what was written, so the newest
state wins even if the last write was lost.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from posecast_wire.messages import RobotStatus

from posecast_relay.core.stream import StoredFrame, Stream

HZ = 2.0  # a free database plan allows more, but each reader pays for every byte
STATUS_S = 0.9  # so that at least one write per second shows that the relay is running
SLACK_S = 0.05  # a check that comes this early still counts

Status = dict[str, str | int | None]
Node = dict[str, str | Status | None]
EMPTY: Node = dict.fromkeys(("schema", "key", "frame"))


@dataclass(frozen=True)
class VisibleRobot:
    """A robot as `anyone` may see it now. `hz`: the most writes per second."""

    stream: Stream
    status: RobotStatus
    hz: float


@dataclass(frozen=True)
class Written:
    """What was written to a node. It keeps the objects themselves, so that changes are found by identity."""

    schema: str | None = None
    key: StoredFrame | None = None
    frame: StoredFrame | None = None
    status: RobotStatus | None = None
    frame_at: float = float("-inf")
    status_at: float = float("-inf")


@dataclass(frozen=True)
class NodeChange:
    """A change to one node.

    `node`: the children to write, with None for those to delete. `node` None: delete the whole node.
    """

    node: Node | None
    after: Written


class Mirror:
    """Remembers what was written. After a write that may have failed, it writes the whole node again."""

    def __init__(self) -> None:
        self._nodes: dict[str, Written | None] = {}  # None: unknown content may exist there

    def record_existing(self, robots: Iterable[str]) -> None:
        """Note nodes that already exist: from an earlier run, or of robots that are hidden now."""
        for robot in robots:
            self._nodes.setdefault(robot, None)

    def find_changes(
        self, shown: Mapping[str, VisibleRobot], now: float, unix_s: float
    ) -> dict[str, NodeChange]:
        """Return the changes to write, by robot.

        Confirm each with `record_written` or `record_lost` before the next call.
        """
        out = {robot: NodeChange(None, Written()) for robot in self._nodes if robot not in shown}
        for robot, this in shown.items():
            before = self._nodes.get(robot)
            change = _change(before or Written(), this, now, unix_s)
            if change is not None:
                # delete any existing content
                whole = EMPTY | (change.node or {}) if before is None else change.node
                out[robot] = NodeChange(whole, change.after)
        return out

    def record_written(self, changes: Mapping[str, NodeChange]) -> None:
        """Note that these changes were written."""
        for robot, change in changes.items():
            if change.node is None:
                self._nodes.pop(robot, None)
            else:
                self._nodes[robot] = change.after

    def record_lost(self, changes: Mapping[str, NodeChange]) -> None:
        """Note that these changes may or may not have been written."""
        for robot in changes:
            self._nodes[robot] = None


def _change(before: Written, this: VisibleRobot, now: float, unix_s: float) -> NodeChange | None:
    stream, node, after = this.stream, Node(), before
    newest = stream.newest if stream.schema is not None else None
    if newest is not before.frame and now >= before.frame_at + 1 / min(this.hz, HZ) - SLACK_S:
        # all or nothing: readers need the frame together with its KEY
        after = Written(
            schema=stream.schema.text if stream.schema is not None and newest is not None else None,
            key=None if newest is None else newest.key or newest,
            frame=newest,
            frame_at=now,
        )
        if after.schema != before.schema:
            node["schema"] = None if after.schema is None else b64encode(after.schema.encode()).decode()
        if after.key is not before.key:
            node["key"] = _base64(after.key)
        node["frame"] = _base64(newest)
    if not node and this.status == before.status and now < before.status_at + STATUS_S:
        return None
    node["status"] = _status(this, after.frame, now, unix_s)
    return NodeChange(node, replace(after, status=this.status, status_at=now))


def _base64(held: StoredFrame | None) -> str | None:
    return None if held is None else b64encode(held.payload).decode()


def _status(this: VisibleRobot, frame: StoredFrame | None, now: float, unix_s: float) -> Status:
    age_s = this.stream.compute_age_s(now)
    return {
        "robot": this.status,
        "age_ms": None if age_s is None else max(0, round(age_s * 1000)),
        "seq": None if frame is None else frame.seq,
        "at": round(unix_s * 1000),
        "model": this.stream.model,
    }
