"""Response schemas of the API, for OpenAPI. Other modules write the documents."""

from __future__ import annotations

from typing import Any, Literal

from posecast_wire.messages import RobotStatus
from pydantic import Field

from posecast_relay.net.answer_cache import AnswerDocument

Value = float | str | list[str] | None


class ErrorAnswer(AnswerDocument):
    """The answer to a refused request. `error`: the reason, in one line."""

    error: str


class RobotSummary(AnswerDocument):
    """A robot in the list. `age_ms` and `seq` describe its newest frame; null before the first one. `hz`:
    frames per second from the robot; null if unknown. `viewers`: at all relays together. `model`: SHA-256 of
    the model's manifest.
    """

    robot: str
    name: str
    status: RobotStatus
    age_ms: int | None
    seq: int | None
    hz: float | None
    viewers: int
    model: str | None


class RobotList(AnswerDocument):
    """The robots that this client can see. `publish_at`: where programs on the relay's machine can publish
    without a credential; only clients on that machine get it.
    """

    robots: list[RobotSummary]
    publish_at: str = Field(default="", json_schema_extra={"examples": ["tcp/127.0.0.1:7447"]})


class PongAnswer(AnswerDocument):
    """The relay's clock, as in the messages of a stream (wire/SPEC.md §6). `t`: as sent."""

    type: Literal["pong"]
    t: float
    clock_ms: int


class RobotDetails(RobotSummary):
    """A robot. `conflict`: two agents publish it. `lateness_ms`: how late its frames arrive. `info`: texts
    that seldom change. `schema`: as the agent declared it (wire/SPEC.md §2); null before the first one.
    """

    view: str
    conflict: bool
    lateness_ms: int
    info: dict[str, str]
    schema_id: str | None
    schema_: dict[str, Any] | None


class FieldState(AnswerDocument):
    """One field. `values`: by label; null means no reading. For a field of bits, each value lists the names
    of the set bits. `units`: the units of labels that differ from `unit`.
    """

    unit: str
    values: dict[str, Value]
    units: dict[str, str] = Field(default={})


class RobotState(AnswerDocument):
    """The newest state. `t`: the robot's clock, in seconds. `seq`, `t` and `fields` are missing if no frame
    can be decoded."""

    robot: str
    view: str
    status: RobotStatus
    age_ms: int | None
    info: dict[str, str]
    seq: int = 0
    t: float = 0.0
    fields: dict[str, FieldState] = Field(default={})


class Readiness(AnswerDocument):
    """Whether viewers are accepted: yes if `ready` or `degraded`. `why`: what is missing, in one line."""

    status: Literal["ready", "degraded", "draining"]
    why: str = ""


class OEmbed(AnswerDocument):
    """oEmbed 1.0 for a robot's page. Type `rich`, with width, height and html, if every site can embed the
    robot; else type `link`.
    """

    version: Literal["1.0"]
    type: Literal["link", "rich"]
    title: str
    provider_name: str
    provider_url: str
    cache_age: int
    thumbnail_url: str = ""
    thumbnail_width: int = 0
    thumbnail_height: int = 0
    width: int = 0
    height: int = 0
    html: str = ""
