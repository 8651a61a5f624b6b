"""What one relay tells others about a robot through Redis: frames, events, and how it is."""

from __future__ import annotations

import json
from typing import NamedTuple

UPDATE, STANDING = b"U", b"S"
HEADER_END = b"\n"


class Update(NamedTuple):
    """A stream has changed. `version` names schema, info and model: another one means that they changed.
    `numbering` names the count of the events: another one began at 1.
    """

    view: str
    generation: int
    run_id: int
    version: str
    numbering: str
    late_s: float  # age of the newest frame when this was sent
    frames: tuple[tuple[int, bytes], ...]  # edge's ns since its run began, and the frame; bases come first
    events: tuple[str, ...]  # numbered, as viewers get them

    def pack(self) -> bytes:
        """One line of JSON, then the frames."""
        doc = {
            "view": self.view,
            "generation": self.generation,
            "run": f"{self.run_id:016x}",
            "version": self.version,
            "numbering": self.numbering,
            "late": round(self.late_s, 4),
            "frames": [(ns, len(frame)) for ns, frame in self.frames],
            "events": self.events,
        }
        head = json.dumps(doc, separators=(",", ":"), ensure_ascii=False).encode()
        return UPDATE + head + HEADER_END + b"".join(frame for _, frame in self.frames)


class Standing(NamedTuple):
    """How a robot is. `ages_s`: of the newest frame by view, None before any live one."""

    token: bool
    ages_s: dict[str, float | None]

    def pack(self) -> bytes:
        """JSON."""
        ages = {view: None if age_s is None else round(age_s, 3) for view, age_s in self.ages_s.items()}
        return STANDING + json.dumps({"token": self.token, "ages": ages}, separators=(",", ":")).encode()


def unpack(data: bytes) -> Update | Standing:
    """ValueError when `data` is neither."""
    try:
        if data[:1] == STANDING:
            doc = json.loads(data[1:])
            ages = {str(view): None if age is None else float(age) for view, age in doc["ages"].items()}
            return Standing(bool(doc["token"]), ages)
        if data[:1] == UPDATE:
            head, _, rest = data[1:].partition(HEADER_END)
            return _update(json.loads(head), rest)
    except (KeyError, TypeError, AttributeError, RecursionError) as e:
        raise ValueError(f"relayed message: {type(e).__name__}") from None
    raise ValueError("relayed message: of an unknown kind")


def _update(doc: dict[str, object], rest: bytes) -> Update:
    frames, at = [], 0
    for ns, size in doc["frames"]:  # type: ignore[attr-defined]
        frames.append((int(ns), rest[at : at + int(size)]))
        at += int(size)
    if at != len(rest):
        raise ValueError("relayed message: of another length than it says")
    run_id = int(str(doc["run"]), 16)
    if not 0 < run_id < 1 << 64:
        raise ValueError("relayed message: no run")
    return Update(
        str(doc["view"]),
        int(doc["generation"]),  # type: ignore[call-overload]
        run_id,
        str(doc["version"]),
        str(doc["numbering"]),
        float(doc["late"]),  # type: ignore[arg-type]
        tuple(frames),
        tuple(str(text) for text in doc["events"]),  # type: ignore[attr-defined]
    )
