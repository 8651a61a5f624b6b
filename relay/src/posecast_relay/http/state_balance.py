"""Computes the balance in a robot's state from a single frame, only on request."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any
from weakref import ReferenceType, WeakKeyDictionary, ref

from posecast_wire import MISSING, Frame, Schema

from posecast_relay.balance.balance import make_balance_document
from posecast_relay.balance.course import BalanceCourse
from posecast_relay.balance.feet import FootChoice, choose_feet
from posecast_relay.balance.model import BalanceModel
from posecast_relay.core.state.stream import Stream
from posecast_relay.http.balance_models import NoBalance
from posecast_relay.kinematics.link_poses import FrameReadings, LinkPoses
from posecast_relay.streaming.turns import Turns

# The event loop that serves all viewers also computes balance, so its time is limited.
LINK_US, FOOT_US, CHANNEL_US = 15, 100, 1  # approximate cost of each; 0.4 ms for the demo robot
ROBOT_US_PER_S = 40_000  # for one robot; further states have no balance
US_PER_S = 100_000  # for all robots, shared equally
NAMED_MAX = 3  # joints without a reading that are listed by name

Choices = WeakKeyDictionary[Stream, tuple[Schema, ReferenceType[BalanceModel], FootChoice]]


class StateBalance:
    """Computes the balance of newest frames, at a bounded rate per robot. `now` is a clock in seconds."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._turns = Turns(now, ROBOT_US_PER_S, US_PER_S)
        self._choices: Choices = WeakKeyDictionary()

    def make_document(
        self, stream: Stream, frame: Frame, model: BalanceModel | NoBalance
    ) -> Mapping[str, Any] | None:
        """Return the member `balance` of a state; None if the robot has no masses and its support is unknown.

        A joint without a reading counts as at rest if it carries almost no mass.
        """
        if isinstance(model, NoBalance):
            return _tell_none(model.code, model.detail)
        choice = self._choose_feet(stream, frame.schema, model)
        if not model.inertials and not choice.feet:
            return _explain_nothing(model, choice.why)
        if not _has_positions(frame):
            return _tell_none("no-positions")
        cost_us = LINK_US * len(model.tree.links) + FOOT_US * len(choice.feet)
        if not self._turns.takes(stream.robot, cost_us + CHANNEL_US * frame.schema.size):
            return _tell_none("busy")
        readings, poses = FrameReadings(frame.schema), LinkPoses(model.tree)
        readings.take(frame.codes)
        poses.update(readings)
        course = BalanceCourse(model, frame.schema, choice)
        world = poses.compute_world_poses()
        found = course.read(frame.codes, readings, world, frame.t_s)
        told = make_balance_document(found)
        detail = "; ".join(filter(None, (model.why, choice.why, _name_joints(found.unread_joints))))
        return {**told, "detail": detail} if detail else told

    def _choose_feet(self, stream: Stream, schema: Schema, model: BalanceModel) -> FootChoice:
        known = self._choices.get(stream)
        if known is None or known[0] is not schema or known[1]() is not model:
            known = self._choices[stream] = schema, ref(model), choose_feet(model, schema)
        return known[2]


def _name_joints(joints: Sequence[str]) -> str:
    """List the joints without a reading, the first ones by name; "" if there are none."""
    more = f" and {len(joints) - NAMED_MAX} more" if len(joints) > NAMED_MAX else ""
    return f"no reading of {', '.join(joints[:NAMED_MAX])}{more}" if joints else ""


def _has_positions(frame: Frame) -> bool:
    """Whether any joint has a reading; without one the pose is unknown."""
    field = frame.schema.find_field("pos")
    return field is not None and any(
        code != MISSING for code in frame.codes[field.start : field.start + field.size]
    )


def _explain_nothing(model: BalanceModel, why: str | None) -> Mapping[str, Any] | None:
    if model.why is not None:
        return _tell_none("bad-model", model.why)
    if model.inertials is None or model.soles is None:
        return _tell_none("old-bundle")
    if model.has_impossible_masses:
        return _tell_none("impossible-masses", why)
    return None if why is None else _tell_none("no-feet", why)


def _tell_none(code: str, detail: str | None = None) -> Mapping[str, Any]:
    return {"why": {"balance": code}} | ({} if detail is None else {"detail": detail})
