"""What the routes answer, for the description of the API: the documents themselves are written elsewhere."""

from __future__ import annotations

from typing import Any, Literal

from posecast_wire.messages import RobotStatus
from pydantic import BaseModel, ConfigDict, Field

Xyz = tuple[float, float, float]
Xy = tuple[float, float]
Value = float | str | list[str] | None


class AnswerDocument(BaseModel):
    """A document with these members and no others."""

    model_config = ConfigDict(extra="forbid")


class ErrorAnswer(AnswerDocument):
    """What every refusal holds: why, in one line."""

    error: str


class RobotSummary(AnswerDocument):
    """A robot in the list. `age_ms` and `seq`: of its newest frame; null before any. `hz`: frames per second
    from the robot; null when not known. `viewers`: over all relays. `model`: SHA-256 of the manifest.
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
    """The robots that the asker may see. `publish_at`: where anybody on the relay's own machine may publish;
    missing for everybody else.
    """

    robots: list[RobotSummary]
    publish_at: str = Field(default="", json_schema_extra={"examples": ["tcp/127.0.0.1:7447"]})


class RobotDetails(RobotSummary):
    """A robot. `conflict`: two edges claim it. `lateness_ms`: how late its frames arrive. `info`: slow texts.
    `schema`: as the edge declared it, wire/SPEC.md §2; null before the first one.
    """

    view: str
    conflict: bool
    lateness_ms: int
    info: dict[str, str]
    schema_id: str | None
    schema_: dict[str, Any] | None

    model_config = ConfigDict(extra="forbid", alias_generator=lambda name: name.rstrip("_"))


class FieldState(AnswerDocument):
    """One field. `values`: by label; of a field of bits the names of those that are set; null is no reading.
    `units`: of labels whose unit is another one.
    """

    unit: str
    values: dict[str, Value]
    units: dict[str, str] = Field(default={})


class FootDocument(AnswerDocument):
    """One foot. `bears`: whether the robot stands on it."""

    bears: bool
    force_n: float | None
    centre_of_pressure_m: Xyz | None


class BalanceState(AnswerDocument):
    """Where the mass is and what the robot stands on, in the world, z up. `feet`: by sensor site or link.
    `why`: the reason for each member that is null; of `balance` where no other member is there.
    """

    mass_kg: float | None = None
    centre_of_mass_m: Xyz | None = None
    ground: Literal["measured", "lowest"] | None = None
    floor_m: float | None = None
    support_polygon_m: list[Xy] | None = None
    margin_mm: float | None = None
    centre_of_pressure_m: Xyz | None = None
    feet: dict[str, FootDocument] = Field(default={})
    why: dict[str, str]
    detail: str = ""


class RobotState(AnswerDocument):
    """The newest state. `t`: the robot's own clock, seconds. `seq`, `t` and `fields` are missing while no
    frame can be decoded; `balance` where the robot has no masses and stands on nothing known.
    """

    robot: str
    view: str
    status: RobotStatus
    age_ms: int | None
    info: dict[str, str]
    seq: int = 0
    t: float = 0.0
    fields: dict[str, FieldState] = Field(default={})
    balance: BalanceState | None = None


class Readiness(AnswerDocument):
    """Whether viewers are accepted: yes when `ready` or `degraded`. `why`: what is missing, in one line."""

    status: Literal["ready", "degraded", "starting", "draining"]
    why: str = ""


class OEmbed(AnswerDocument):
    """oEmbed 1.0 of a robot's page. Of type `rich`, with width, height and html, where every page may frame
    the robot, else of type `link`.
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


def describe_bytes(media_type: str, description: str) -> dict[int | str, dict[str, Any]]:
    """An answer of bytes, for the description of a route."""
    schema = {"type": "string", "format": "binary"}
    return {200: {"description": description, "content": {media_type: {"schema": schema}}}}
