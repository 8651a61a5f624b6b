"""The robots and viewers of one process, and the last status sent to viewers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sized
from dataclasses import replace
from functools import partial

from posecast_wire import Close

from posecast_relay.core.actions import Action, CloseConnection, Fault, Persist
from posecast_relay.core.limits import Limits
from posecast_relay.core.past.recorder import Recorder
from posecast_relay.core.policy.admission import Refusal
from posecast_relay.core.policy.lane import RetryPace
from posecast_relay.core.state.robot import Robot
from posecast_relay.core.state.room import Room
from posecast_relay.core.viewer.viewer import Viewer
from posecast_relay.kit import TimerQueue


class Headcount:
    """Counts the viewers of all hubs in one process, which share one limit."""

    def __init__(self) -> None:
        self._hubs: list[tuple[Sized, Sized]] = []

    def include(self, viewers: Sized, previews: Sized) -> None:
        """Add a hub's viewers, and the previews among them. Their sizes are read at every count."""
        self._hubs.append((viewers, previews))

    def count_viewers(self) -> int:
        """Return how many viewers all hubs have now, previews included."""
        return sum(len(viewers) for viewers, _ in self._hubs)

    def count_previews(self) -> int:
        """Return how many of them are previews."""
        return sum(len(previews) for _, previews in self._hubs)


class Roster:
    """Adds and removes robots and viewers. `Uplink` and `Hub` handle their messages."""

    def __init__(
        self, limits: Limits, headcount: Headcount | None = None, recorder: Recorder | None = None
    ) -> None:
        """`headcount` is shared by all hubs of a process; None: this is the only hub.

        `recorder` gets everything that is accepted; None: nothing is recorded.
        """
        self.limits = limits
        self.headcount = Headcount() if headcount is None else headcount
        self.recorder = recorder
        self.robots: dict[str, Robot] = {}
        self.publishers = 0  # of the robots, those that have sent something
        self.viewers: dict[Viewer, Room] = {}
        self.admitted: Counter[tuple[str, str]] = Counter()  # viewers by robot and audience
        self.previews: dict[Viewer, None] = {}  # of the viewers, in the order in which they joined
        self.admitted_previews: Counter[tuple[str, str]] = Counter()  # previews by robot and audience
        self.headcount.include(self.viewers, self.previews)
        self.endings: Counter[int] = Counter()  # of viewers, by close code
        self.preview_endings: Counter[int] = Counter()  # of previews, by close code, counted separately
        self.sent_to_lane = 0  # of the viewers that were refused
        self._retry_pace = RetryPace()
        self.delivered = 0  # by rooms that are gone; likewise below
        self.skipped = 0
        self.degraded = False  # this relay can't hear any robot, through its own problem
        self.wake_at = 0.0  # call `tick` then, or a little later
        self.flushes = TimerQueue[Room]()  # frames that wait until a viewer is due
        self.questions = TimerQueue[Robot]()  # snapshots to request
        self.changed: dict[Room, None] = {}  # since the last flush
        self.statuses: dict[Room, str] = {}  # the last status sent to its viewers

    def admit_robot(self, name: str) -> Robot | None:
        """Return the publishing robot with this name, created if it is new.

        None if the limit is reached.
        """
        robot = self.robots.get(name)
        if robot is not None and robot.counted:
            return robot
        if self.publishers >= self.limits.robots:
            return None
        if robot is None:
            robot = self.robots[name] = Robot(name, self.limits)
        robot.mark_counted()
        self.publishers += 1
        return robot

    def admit_view(self, name: str, view: str) -> tuple[Robot, Room] | None:
        """Return a robot and the room of one of its views.

        None if a limit on robots or views is reached.
        """
        robot = self.admit_robot(name)
        if robot is None or (view not in robot.rooms and len(robot.rooms) >= self.limits.views):
            return None
        return robot, robot.get_room(view)

    def plan_flush(self, room: Room) -> None:
        """Schedule the next `flush` of a room, and make `wake_at` earlier if needed."""
        self.flushes.put(room, room.find_wake_at())
        self.wake_at = min(self.wake_at, self.flushes.next_at)

    def plan_question(self, robot: Robot) -> None:
        """Schedule the next request for this robot's snapshots, and make `wake_at` earlier if needed."""
        self.questions.put(robot, robot.ask_at)
        self.wake_at = min(self.wake_at, self.questions.next_at)

    def drop_robot(self, robot: Robot) -> None:
        """Forget a robot. It must have no viewers."""
        del self.robots[robot.name]
        self.publishers -= robot.counted
        for room in robot.rooms.values():
            self.delivered += room.delivered
            self.skipped += room.skipped
            self.statuses.pop(room, None)
            self.changed.pop(room, None)

    def add_viewer(self, viewer: Viewer, room: Room) -> None:
        """Count a viewer, which is about to join this room."""
        if viewer.grant is not None:
            self.admitted[viewer.robot, viewer.grant.by] += 1
            self.admitted_previews[viewer.robot, viewer.grant.by] += viewer.is_preview
        if viewer.is_preview:
            self.previews[viewer] = None
        self.viewers[viewer] = room

    def remove_viewer(self, viewer: Viewer) -> None:
        """Remove a viewer whose connection is gone. Does nothing if it was already removed."""
        room = self.viewers.pop(viewer, None)
        if room is None:
            return
        room.leave(viewer)
        self.previews.pop(viewer, None)
        if viewer.grant is not None:
            self.admitted[viewer.robot, viewer.grant.by] -= 1
            self.admitted_previews[viewer.robot, viewer.grant.by] -= viewer.is_preview
        robot = self.robots.get(viewer.robot)
        if robot is not None and robot.heard_at is None and not robot.has_viewers():
            self.drop_robot(robot)

    def set_degraded(self, degraded: bool) -> None:
        """Set whether this relay can hear any robot at all. ReplicaFeed tells the viewers."""
        self.degraded = degraded

    def set_wake(self, at: float) -> None:
        """Set the time of the next `tick`, in seconds of the core's clock."""
        self.wake_at = at

    # ---- boundaries -------------------------------------------------------

    def guard(self, of: Viewer | Room | None, call: Callable[[], list[Action]]) -> list[Action]:
        """Return what `call` returns.

        If it raises, only this viewer, or the viewers of this room, are ended.
        """
        try:
            return call()
        except Exception as error:
            return self.end_after_fault(of, error)

    def end_after_fault(self, of: Viewer | Room | None, error: Exception) -> list[Action]:
        """End the viewer, or all viewers of the room, for which the relay's own code has failed."""
        viewers = [of] if isinstance(of, Viewer) else list(of.viewers) if of is not None else []
        where = "" if of is None else f"{of.robot}/{of.view}"
        out: list[Action] = [Fault(where, error)]
        for viewer in viewers:
            room = self.viewers.get(viewer)
            try:
                self.remove_viewer(viewer)
            except Exception as e:
                out.append(Fault(where, e))
                if room is not None:
                    room.evict(viewer)
            self.count_ending(Close.INTERNAL_ERROR, viewer.is_preview)
            out.append(CloseConnection(viewer, Close.INTERNAL_ERROR, "internal error of the relay", None))
        return out

    def end_viewer(self, viewer: Viewer, close: Close, reason: str, retry_s: float | None) -> list[Action]:
        """Remove a viewer, count the reason, and close its connection."""
        self.remove_viewer(viewer)
        self.count_ending(close, viewer.is_preview)
        return [CloseConnection(viewer, close, reason, retry_s)]

    def count_ending(self, close: int, is_preview: bool) -> None:
        """Count that a viewer was disconnected or refused, by close code. Previews are counted separately."""
        (self.preview_endings if is_preview else self.endings)[close] += 1

    def count_refusal(self, refusal: Refusal, is_preview: bool, now: float) -> Refusal:
        """Count a refusal by close code, and whether it names the lane.

        Returns what to send: if many viewers are sent to the lane, a longer time until they retry.
        """
        self.count_ending(refusal.close, is_preview)
        if refusal.lane is None or refusal.retry_s is None:
            return refusal
        self.sent_to_lane += 1
        return replace(refusal, retry_s=self._retry_pace.choose_retry_s(refusal.retry_s, now))

    def remove_ended(self, actions: list[Action]) -> list[Action]:
        """Remove and count the viewers that these actions close. Returns the actions unchanged."""
        for action in actions:
            if isinstance(action, CloseConnection):
                self.remove_viewer(action.viewer)
                self.count_ending(action.close, action.viewer.is_preview)
        return actions

    @staticmethod
    def persist_views(robot: Robot) -> list[Action]:
        """Return one action per view that saves this robot's streams in the store."""
        return [Persist(room.stream) for room in robot.rooms.values()]

    def report_statuses(self, robot: Robot, now: float) -> list[Action]:
        """Send the robot's status to the viewers of each room where it has changed."""
        out: list[Action] = []
        for room in robot.rooms.values():
            if room.viewers:
                out += self.guard(room, partial(self.report_status, robot, room, now))
        return out

    def report_status(self, robot: Robot, room: Room, now: float) -> list[Action]:
        """Send the robot's status to the viewers of one room, if it has changed."""
        if room in self.changed:
            return []  # its frame has not been sent yet: `flush` sends both together
        return (
            room.send_status(robot.compute_status(room, now), now)
            if self.record_status(robot, room, now)
            else []
        )

    def record_status(self, robot: Robot, room: Room, now: float) -> bool:
        """Note the robot's status in a room. Returns True if it has changed, so that the caller must send
        it."""
        status, over_share = robot.compute_status(room, now), bool(robot.share.find_exceeded_limit(now))
        if self.statuses.get(room) == status and room.over_share == over_share:
            return False
        self.statuses[room] = status
        room.set_over_share(over_share)
        return True
