"""What an edge says beside its frames: an event, or its info. Read as a stranger's text, told as JSON."""

from __future__ import annotations

import json

from posecast_wire.checked import loads

from posecast_relay.core.limits import Limits


def edge_said(payload: bytes, limits: Limits) -> dict[str, object] | None:
    """An event or info (by its `type`), or None when it is neither."""
    if len(payload) > max(limits.event_bytes, limits.info_bytes):
        return None
    try:
        doc = loads(payload.decode())
        json.dumps(doc, allow_nan=False)  # 1e999 is JSON, but what it reads as cannot be written again
    except (ValueError, RecursionError):
        return None
    if not isinstance(doc, dict):
        return None
    if doc.get("type") == "info":
        kv = doc.get("kv")
        return doc if isinstance(kv, dict) and all(isinstance(text, str) for text in kv.values()) else None
    if doc.get("type") != "event" or len(payload) > limits.event_bytes:
        return None
    texts = all(isinstance(doc.get(name), str) for name in ("level", "source", "text", "state"))
    return doc if texts and isinstance(doc.get("t"), (int, float)) else None


def conflict_event(t_s: float, present: bool) -> dict[str, object]:
    """The relay's own event: a second edge claims this robot, or no longer does. `t_s`: robot clock."""
    return {
        "type": "event",
        "t": t_s,
        "level": "caution",
        "source": "relay",
        "text": "another edge claims this robot",
        "state": "on" if present else "off",
    }
