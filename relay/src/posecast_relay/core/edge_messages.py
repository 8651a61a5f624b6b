"""Validates the JSON messages that an edge sends along with its frames: events, info and model."""

from __future__ import annotations

import re
from collections.abc import Callable

from posecast_wire.checked import is_number, loads
from posecast_wire.messages import TIME_MAX_S

from posecast_relay.core.limits import Limits

SHA256 = re.compile("[0-9a-f]{64}")
LEVELS = ("fault", "caution", "info")
STATES = ("on", "off")


def read_edge_message(payload: bytes, limits: Limits) -> dict[str, object] | None:
    """Parse an event, info or model (chosen by `type`) and keep the members that viewers know.

    Returns None if the message is invalid. The result can always be written as JSON in UTF-8.
    """
    if len(payload) > max(limits.event_bytes, limits.info_bytes):
        return None
    try:
        doc = loads(payload)
    except ValueError:
        return None
    kind = doc.get("type") if isinstance(doc, dict) else None
    members = MEMBERS.get(kind) if isinstance(kind, str) else None
    if (
        not isinstance(doc, dict)
        or members is None
        or (kind == "event" and len(payload) > limits.event_bytes)
    ):
        return None
    if not all(is_sound(doc.get(name)) for name, is_sound in members.items()):
        return None
    return {"type": kind} | {name: doc[name] for name in members}


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _is_texts(value: object) -> bool:
    return isinstance(value, dict) and all(isinstance(text, str) for text in value.values())


MEMBERS: dict[str, dict[str, Callable[[object], bool]]] = {
    "event": {
        "t": lambda value: is_number(value, -TIME_MAX_S, TIME_MAX_S),
        "level": lambda value: value in LEVELS,
        "source": _is_text,
        "text": _is_text,
        "state": lambda value: value in STATES,
    },
    "info": {"kv": _is_texts},
    "model": {"hash": lambda value: isinstance(value, str) and SHA256.fullmatch(value) is not None},
}


def make_conflict_event(t_s: float, present: bool) -> dict[str, object]:
    """Make the relay's own event for a second edge that claims this robot, or no longer does.

    `t_s`: seconds of the robot's clock.
    """
    t_s = max(-TIME_MAX_S, min(t_s, TIME_MAX_S))
    return {
        "type": "event",
        "t": t_s,
        "level": "caution",
        "source": "relay",
        "text": "another edge claims this robot",
        "state": "on" if present else "off",
    }
