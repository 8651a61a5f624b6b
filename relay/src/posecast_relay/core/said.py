"""What an edge says beside its frames: an event, its info or model. Read as a stranger's, told as JSON."""

from __future__ import annotations

import json
import re

from posecast_wire.checked import loads

from posecast_relay.core.limits import Limits

SHA256 = re.compile("[0-9a-f]{64}")


def edge_said(payload: bytes, limits: Limits) -> dict[str, object] | None:
    """An event, info or model (by its `type`), or None when it is none of them."""
    if len(payload) > max(limits.event_bytes, limits.info_bytes):
        return None
    try:
        doc = loads(payload.decode())
        json.dumps(doc, allow_nan=False)  # 1e999 is JSON, but what it reads as cannot be written again
    except (ValueError, RecursionError):
        return None
    return doc if isinstance(doc, dict) and _is_sound(doc, len(payload), limits) else None


def _is_sound(doc: dict[str, object], size: int, limits: Limits) -> bool:
    kind = doc.get("type")
    if kind == "info":
        kv = doc.get("kv")
        return isinstance(kv, dict) and all(isinstance(text, str) for text in kv.values())
    if kind == "model":
        digest = doc.get("hash")
        return isinstance(digest, str) and SHA256.fullmatch(digest) is not None
    texts = all(isinstance(doc.get(name), str) for name in ("level", "source", "text", "state"))
    return kind == "event" and size <= limits.event_bytes and texts and isinstance(doc.get("t"), (int, float))


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
