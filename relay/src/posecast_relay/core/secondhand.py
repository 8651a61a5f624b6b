"""What a gateway learns of robots: not from edges, but from relays that hear them, and numbered already."""

from __future__ import annotations

from collections.abc import Mapping

from posecast_relay.core.actions import Action
from posecast_relay.core.hub import Hub


class Secondhand:
    """Brings into a hub what other relays tell. Frames and snapshots come in as an edge's own do."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub

    def event(self, robot: str, view: str, numbering: str, text: str) -> list[Action]:
        """An event that another relay has numbered. One that came before is left out. ValueError."""
        found = self._hub.publisher(robot, view)
        if found is None:
            return []
        _, room = found
        event = room.stream.heard_of(numbering, text)
        return [] if event is None else self._hub.told(room.announce(event))

    def standing(
        self, robot: str, token: bool, ages_s: Mapping[str, float | None], now: float
    ) -> list[Action]:
        """How a robot is, told by a relay that hears it; `ages_s` by view."""
        found = self._hub.admit(robot)
        if found is None:
            return []
        found.heard_at = now
        for view, age_s in ages_s.items():
            room = found.rooms.get(view)
            if room is not None and age_s is not None:
                room.stream.aged(age_s, now)
        if found.liveness.token != token:
            return self._hub.token(robot, token, now)
        return self._hub.words_changed(found, now)

    def lacks(self, robot: str) -> None:
        """Something of this robot changed that only a snapshot brings: ask, at most once a second."""
        of = self._hub.robots.get(robot)
        if of is not None:
            of.lacking = True
            self._hub.ask_about(of)

    def degrade(self, degraded: bool, now: float, robot: str | None = None) -> list[Action]:
        """This relay ceases, or begins again, to hear of one robot or of all of them. Viewers are told."""
        hub = self._hub
        if robot is None:
            hub.degraded = degraded
        elif robot in hub.robots:
            hub.robots[robot].degraded = degraded
        out: list[Action] = []
        for of in hub.robots.values():
            for room in of.rooms.values():
                if room.degraded != (hub.degraded or of.degraded):
                    room.degraded = not room.degraded
                    out += room.report(of.word(room, now), now)
        return out

    def forget(self, robot: str) -> None:
        """Nobody here watches it, and this relay stops listening for it."""
        of = self._hub.robots.get(robot)
        if of is not None and not of.has_viewers():
            self._hub.drop(of)
