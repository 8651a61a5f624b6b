"""Histories that once failed, each cut down to what it takes."""

from __future__ import annotations

from .histories import Step

KEPT: dict[str, list[Step]] = {
    "an edge that starts before any ingest": [
        ("edge", "a", 0, 1),
    ],
    "a password that is refused from the first frame on": [
        ("ingest",), ("gateway",), ("edge", "a", 0, 1), ("wait", 0.05), ("redis_is", "locked", True),
        ("wait", 6.0),
    ],
    "a lease of another type when its writer is killed": [
        ("ingest",), ("ingest",), ("gateway",), ("edge", "a", 0, 1), ("wait", 1.0),
        ("redis_does", "spoil", "*"), ("kill_ingest", 0),
    ],
    "a write that was under way while Redis stood still": [
        ("ingest",), ("gateway",), ("edge", "a", 0, 1), ("wait", 0.1), ("redis_is", "frozen", True),
        ("stop", 0, True), ("wait", 1.2), ("redis_does", "lose", "posecast:{a}:public:state"),
        ("wait", 1.2),
    ],
    "a dead run's ingest takes over an emptied Redis": [
        ("ingest",), ("ingest",), ("gateway",), ("edge", "a", 0, 1), ("edge", "a", 0), ("stop", 0, True),
        ("wait", 4.0), ("redis_does", "lose", "*"),
    ],
    "an edge that sends nothing answers a new ingest first": [
        ("ingest",), ("gateway",), ("edge", "a", 0, 1), ("wait", 1.0), ("edge", "a", 0, 1),
        ("silence", 0, False), ("ingest",),
    ],
    "a second edge comes and is killed": [
        ("ingest",), ("gateway",), ("edge", "a", 0, 1), ("wait", 2.5), ("edge", "a", 0, 1), ("wait", 1.2),
        ("stop", 1, True),
    ],
    "edges that send nothing answer a new ingest": [
        ("ingest",), ("ingest",), ("gateway",), ("edge", "a", 0, 1), ("edge", "b", 1), ("edge", "b", 0),
        ("silence", 2, False), ("quiet",), ("kill_ingest", 1), ("wait", 4.0), ("silence", 1, False),
        ("kill_ingest", 0),
    ],
    "one of two links is lost": [
        ("ingest",), ("ingest",), ("gateway",), ("edge", "a", 0, 1), ("edge", "b", 0, 1),
        ("edge", "b", 0, 1), ("wait", 2.5), ("link", 1, 1, False),
    ],
    "a second edge at one ingest while the other has only begun": [
        ("ingest",), ("gateway",), ("edge", "b", 0, 1), ("wait", 0.7), ("ingest",), ("wait", 0.05),
        ("edge", "b", 0),
    ],
    "runs change places twice within the delay": [
        ("ingest",), ("gateway",), ("edge", "b", 0, 1), ("wait", 0.7), ("ingest",), ("edge", "b", 0),
    ],
    "a KEY that is a picture, and later a base, within the delay": [
        ("ingest",), ("ingest",), ("gateway",), ("edge", "a", 0, 1), ("wait", 4.0),
        ("redis_is", "locked", False), ("edge", "a", 0, 1), ("wait", 0.05), ("kill_ingest", 1),
    ],
    "a clock that stood still, seen with a delay": [
        ("ingest",), ("edge", "a", 0, 1), ("gateway",), ("clock", 0, 0.0), ("wait", 2.5),
    ],
    "a picture of a known age, seen with a delay": [
        ("ingest",), ("edge", "a", 0, 1), ("silence", 0, False), ("redis_is", "frozen", True),
        ("gateway",),
    ],
    "a standing that Redis keeps for longer since its clock was set back": [
        ("edge", "a", 0, 1), ("quiet",), ("redis_clock", -5.0), ("stop", 0, False), ("kill_ingest", 0),
        ("wait", 2.5),
    ],
    "the word before the picture that it speaks of": [
        ("ingest",), ("ingest",), ("gateway",), ("edge", "a", 0, 1), ("wait", 1.0),
        ("redis_clock", -3600.0), ("wait", 0.7), ("kill_ingest", 1), ("wait", 0.3), ("kill_ingest", 0),
        ("wait", 1.2), ("redis_does", "spoil", "*"), ("wait", 0.3),
    ],
    "restarts within a moment, the last at the other ingest": [
        ("ingest",), ("ingest",), ("gateway",), ("edge", "a", 0, 1), ("wait", 1.0),
        *[("stop", 0, False), ("edge", "a", 0)] * 13, ("stop", 0, False), ("edge", "a", 1),
    ],
    "killed as it starts, and started anew at one of its ingests": [
        ("ingest",), ("ingest",), ("edge", "a", 0, 1), ("stop", 0, True), ("edge", "a", 0),
    ],
    "the last frame before Redis became slow was late itself, seen with a delay": [
        ("gateway",), ("edge", "a", 0), ("ingest",), ("wait", 4.05), ("redis_is", "delay_s", 0.2),
        ("wait", 2.5),
    ],
    "the first frame of a run and then its token within a moment, seen with a delay": [
        ("edge", "a", 0), ("quiet",), ("stop", 0, False), ("edge", "a", 1), ("quiet",), ("kill_ingest", 0),
        ("redis_is", "locked", True),
    ],
    "a run that comes back as a picture, seen with a delay": [
        ("edge", "a", 0), ("quiet",), ("edge", "a", 0), ("wait", 1.2), ("redis_is", "locked", True),
        ("stop", 1, False), ("wait", 3.5), ("stop", 0, False),
    ],
}  # fmt: skip
