"""The faults that have begun and not ended, according to events."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping

from posecast_wire.segment.records import OPEN_FAULTS_MAX

from posecast_relay.core.stream import Event


class OpenFaults:
    """Follows the events of one stream. Beyond a hundred open faults it forgets the oldest."""

    def __init__(self, events: Iterable[Event] = ()) -> None:
        """`events`: earlier events, oldest first."""
        self._texts: dict[tuple[object, object], str] = {}  # by source and text
        for event in events:
            self.record_event(json.loads(event.text), event.text)

    def record_event(self, doc: Mapping[str, object], text: str) -> None:
        """Record an event. `text`: its JSON, as every viewer got it."""
        key = doc.get("source"), doc.get("text")
        self._texts.pop(key, None)
        if doc.get("state") == "on":
            self._texts[key] = text
            if len(self._texts) > OPEN_FAULTS_MAX:
                del self._texts[next(iter(self._texts))]

    def list_texts(self) -> tuple[str, ...]:
        """Return the events that began the open faults, oldest first."""
        return tuple(self._texts.values())
