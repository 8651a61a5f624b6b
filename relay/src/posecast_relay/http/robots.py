"""Makes JSON documents about robots: the list, and a robot's newest state, for scripts and notebooks.

Each shows only what the client may see. States are decoded only on request.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

from posecast_wire import MISSING, Frame

from posecast_relay.auth.access import Access
from posecast_relay.core.policy import ANYONE, PUBLIC, Applicant, Grant, Principal, Refusal
from posecast_relay.core.robot import Robot
from posecast_relay.core.room import Room
from posecast_relay.core.stream import Stream
from posecast_relay.kit import json_bytes
from posecast_relay.net.encodings import DecodeCache, list_field_values

VEILED = {"age_ms": None, "seq": None, "hz": None, "model": None}


def make_robots_document(access: Access, who: Principal, now: float, publish_at: str | None) -> bytes:
    """Return the list of robots as JSON: all that were heard here or by processes that write to the store.
    `publish_at`: where programs on the relay's machine can publish without a credential. None if they can't,
    or if the client is on another machine.
    """
    told = access.live.store.list_robots()
    if told is None:
        names = [robot.name for robot in access.live.hub.robots.values() if robot.heard_at is not None]
        told = [{"robot": name} for name in sorted(names)]
    shown = []
    for doc in told:
        try:
            grant = access.admit(Applicant(doc["robot"], who=who))
            if isinstance(grant, Refusal):
                continue
            summary = _find_summary(access, grant, doc, now)
            if summary is not None and not _never_spoke(summary, grant):
                shown.append(json_bytes(summary | {"viewers": access.count_viewers(doc["robot"])}))
        except Exception as e:  # a bug in the relay: show the others
            access.live.report_fault("a robot in the list", e)
    more = b"" if publish_at is None else json_bytes({"publish_at": publish_at})[1:-1] + b","
    return b"{" + more + b'"robots":[' + b",".join(shown) + b"]}"


def find_open_summary(access: Access, robot: str) -> dict[str, Any] | None:
    """Return one robot's entry in the list as anyone sees it; None if it is not public."""
    grant = access.admit(Applicant(robot, who=ANYONE))
    if isinstance(grant, Refusal):
        return None
    told = access.live.store.list_robots() or ()
    doc = next((doc for doc in told if doc["robot"] == robot), {"robot": robot})
    summary = _find_summary(access, grant, doc, access.live.now())
    return None if summary is None or _never_spoke(summary, grant) else summary


def _never_spoke(summary: dict[str, Any], grant: Grant) -> bool:
    """Whether a robot has left without sending a frame, so that nobody could ever watch it."""
    hidden = grant.view != PUBLIC  # other processes report only the public view
    return summary["status"] == "offline" and summary.get("age_ms") is None and not hidden


def _find_summary(access: Access, grant: Grant, doc: dict[str, Any], now: float) -> dict[str, Any] | None:
    """Return one robot's entry for this client.

    `doc`: the public view without delay, as reported by another process.
    """
    if "status" in doc and grant.delay_s == 0:
        return doc if grant.view == PUBLIC else doc | VEILED | {"name": grant.robot}
    found = access.find_robot(grant)
    return make_robot_summary(*found, now) if found is not None else None


def make_robot_document(access: Access, grant: Grant, robot: Robot, room: Room | None, now: float) -> bytes:
    """Return one robot as JSON, with the schema and info of the view that the client may see."""
    stream = room.stream if room else None
    schema = stream.schema if stream else None
    document = make_robot_summary(robot, room, now) | {
        "view": grant.view,
        "viewers": access.count_viewers(robot.name),
        "conflict": robot.in_conflict,
        "lateness_ms": round(robot.runs.lateness_s * 1000),
        "info": stream.info if stream else {},
        "schema_id": f"{schema.id:08x}" if schema else None,
    }
    told = schema.text.encode() if schema else b"null"  # as received: no need to parse it
    return json_bytes(document)[:-1] + b',"schema":' + told + b"}"


def make_robot_summary(robot: Robot, room: Room | None, now: float) -> dict[str, Any]:
    """Return one robot's entry in the list, based on one of its views."""
    stream = room.stream if room else None
    age_s = stream.compute_age_s(now) if stream else None
    hz = stream.cadence.hz if stream else 0.0
    return {
        "robot": robot.name,
        "name": stream.schema.robot if stream and stream.schema else robot.name,
        "status": robot.compute_status(room, now),
        "age_ms": None if age_s is None else max(0, round(age_s * 1000)),
        "seq": stream.newest.seq if stream and stream.newest else None,
        "hz": round(hz, 1) if hz else None,
        "viewers": robot.count_viewers(),
        "model": stream.model if stream else None,
    }


DECODE_S = 0.1  # minimum time between two decodings, for any number of requests


class _Known(NamedTuple):
    """A decoded frame, as JSON, with its age at that time."""

    at: float
    age_s: float
    text: bytes  # its members of the document


class StateReader:
    """Decodes a stream's newest frame, at most ten times a second per stream, or at the grant's rate."""

    def __init__(self, now: Callable[[], float], decoded: DecodeCache) -> None:
        self._now = now
        self._newest = decoded
        self._known: WeakKeyDictionary[Stream, dict[float, _Known]] = WeakKeyDictionary()

    def read(self, robot: Robot, room: Room, hz: float) -> bytes:
        """Return a room's newest state as JSON. `hz`: how often it may be decoded.

        The room must have a newest frame.
        """
        now, stream = self._now(), room.stream
        every_s = max(DECODE_S, 1 / hz)
        of_stream = self._known.setdefault(stream, {})  # by rate: at most as many as the policy has
        known = of_stream.get(every_s)
        age_s = stream.compute_age_s(now)
        if known is None or now - known.at >= every_s:
            frame = self._newest.decode_frame(stream)
            if frame is not None:
                known = of_stream[every_s] = _Known(now, age_s or 0.0, _encode_frame(frame))
        if known is not None:  # the age of the decoded frame: a newer one may not be decoded yet
            age_s = known.age_s + now - known.at
        document = {
            "robot": stream.robot,
            "view": stream.view,
            "status": robot.compute_status(room, now),
            "age_ms": None if age_s is None else max(0, round(age_s * 1000)),
            "info": stream.info,
        }
        return json_bytes(document)[:-1] + (b"" if known is None else known.text) + b"}"


def _encode_frame(frame: Frame) -> bytes:
    """Encode a frame as the last members of the JSON document."""
    document = {"seq": frame.seq, "t": round(frame.t_s, 6), "fields": _read_fields(frame)}
    return b"," + json_bytes(document)[1:-1]


def _read_fields(frame: Frame) -> dict[str, Any]:
    """Return the values by field and label; for a field of bits, the names of the set bits."""
    found: dict[str, Any] = {}
    for field in frame.schema.fields:
        codes = frame.codes[field.start : field.start + field.size]
        if field.bits:
            values: list[Any] = [None if c == MISSING else field.bits_set(c) for c in codes]
        else:
            values = list(list_field_values(frame, field))
        found[field.name] = {"unit": field.unit, "values": dict(zip(field.labels, values, strict=True))}
        if units := frame.schema.mapping.units.get(field.name):
            found[field.name]["units"] = dict(units)  # of channels with a different unit
    return found
