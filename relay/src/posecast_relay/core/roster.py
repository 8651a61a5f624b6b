"""Who is here: the robots and viewers of one process, and who was told what of whom."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from posecast_wire import Close

from posecast_relay.core.actions import Action, End, Keep
from posecast_relay.core.agenda import Agenda
from posecast_relay.core.limits import Limits
from posecast_relay.core.robot import Robot
from posecast_relay.core.room import Room
from posecast_relay.core.viewer import Viewer


class Roster:
    """Comings and goings. What becomes of their messages is the hub's."""

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self.robots: dict[str, Robot] = {}
        self.viewers: dict[Viewer, Room] = {}
        self.admitted: Counter[tuple[str, str]] = Counter()  # viewers by robot and audience
        self.elsewhere: Callable[[], int] = lambda: 0  # viewers that another hub of this process has
        self.endings: Counter[int] = Counter()  # of viewers, by close code
        self.delivered = 0  # by rooms that are forgotten; and so on
        self.skipped = 0
        self.degraded = False  # no robot is heard of, for a reason of this relay's own
        self.wake_at = 0.0  # `tick` wants to be called then, or a little later
        self.flushes = Agenda[Room]()  # frames that wait for a viewer's period to pass
        self.questions = Agenda[Robot]()  # snapshots to be asked for
        self.changed: dict[Room, None] = {}  # since the last flush
        self.words: dict[Room, str] = {}  # how its robot is, as its viewers were told last

    def admit(self, name: str) -> Robot | None:
        """A robot that was heard of, made when it is new; None when there are as many as the limits allow."""
        robot = self.robots.get(name)
        if robot is None:
            known = sum(1 for r in self.robots.values() if r.heard_at is not None)
            if known >= self.limits.robots:
                return None
            robot = self.robots[name] = Robot(name, self.limits)
        return robot

    def publisher(self, name: str, view: str) -> tuple[Robot, Room] | None:
        """Likewise, with the room of one of its views."""
        robot = self.admit(name)
        if robot is None or (view not in robot.rooms and len(robot.rooms) >= self.limits.views):
            return None
        return robot, robot.room(view)

    def plan(self, room: Room) -> None:
        """See to it that its `flush` is called in time."""
        self.flushes.put(room, room.wake_at())
        self.wake_at = min(self.wake_at, self.flushes.next_at)

    def ask_about(self, robot: Robot) -> None:
        """See to it that its edge is asked for what is lacking."""
        self.questions.put(robot, robot.ask_at)
        self.wake_at = min(self.wake_at, self.questions.next_at)

    def drop(self, robot: Robot) -> None:
        """Know nothing of this robot any more. Nobody may watch it."""
        del self.robots[robot.name]
        for room in robot.rooms.values():
            self.delivered += room.delivered
            self.skipped += room.skipped
            self.words.pop(room, None)
            self.changed.pop(room, None)

    def leave(self, viewer: Viewer) -> None:
        """A viewer's connection is gone; harmless when it was let go of before."""
        room = self.viewers.pop(viewer, None)
        if room is None:
            return
        room.leave(viewer)
        if viewer.grant is not None:
            self.admitted[viewer.robot, viewer.grant.by] -= 1
        robot = self.robots.get(viewer.robot)
        if robot is not None and robot.heard_at is None and not robot.has_viewers():
            self.drop(robot)

    def end(self, viewer: Viewer, close: Close, reason: str, retry_s: float | None) -> list[Action]:
        """Let a viewer go, and count it."""
        self.leave(viewer)
        self.endings[close] += 1
        return [End(viewer, close, reason, retry_s)]

    def told(self, actions: list[Action]) -> list[Action]:
        """What a room returned; whoever it had to let go of is counted."""
        for action in actions:
            if isinstance(action, End):
                self.leave(action.viewer)
                self.endings[action.close] += 1
        return actions

    @staticmethod
    def kept(robot: Robot) -> list[Action]:
        """Every view of this robot is for the store."""
        return [Keep(room.stream) for room in robot.rooms.values()]

    def words_changed(self, robot: Robot, now: float) -> list[Action]:
        """Tell its viewers how it is, where that is not what they were told last."""
        out: list[Action] = []
        for room in robot.rooms.values():
            if room.viewers:
                out += self.word_changed(robot, room, now)
        return out

    def word_changed(self, robot: Robot, room: Room, now: float) -> list[Action]:
        """The same for one of its rooms."""
        word = robot.word(room, now)
        if self.words.get(room) == word:
            return []
        self.words[room] = word
        return room.report(word, now)
