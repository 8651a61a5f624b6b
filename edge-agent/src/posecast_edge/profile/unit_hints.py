"""Units that the numbers speak against. Pure."""

from __future__ import annotations

from posecast_edge.pipeline.source_stats import Channel
from posecast_edge.profile.field_defaults import WELL_KNOWN

TURN = 6.2832
# field → the largest magnitude that a robot's reading in the field's unit has, and what larger ones may be
MOST = {
    "ref": (1.5 * TURN, "degrees"),
    "pos": (1.5 * TURN, "degrees"),
    "tilt": (0.6 * TURN, "degrees"),
    "vel": (60.0, "degrees a second"),
    "gyro": (60.0, "degrees a second"),
    "cur": (100.0, "mA"),
    "amp": (500.0, "mA"),
    "volt": (1000.0, "mV"),
    "temp": (200.0, "kelvin or °F"),
    "acc": (500.0, "mm/s²"),
    "base": (100.0, "mm"),
    "ftf": (20_000.0, "mN"),
    "ftm": (5_000.0, "N·mm"),
}


def unit_hint(field: str, channel: Channel) -> str | None:
    """What the numbers look like when they can hardly be in the field's usual unit."""
    most, instead = MOST.get(field, (float("inf"), ""))
    return instead if channel.largest > most else None


def unit_of(field: str) -> str:
    """What a field of that name is usually in; "" when nobody says."""
    known = WELL_KNOWN.get(field)
    return known.unit if known else ""
