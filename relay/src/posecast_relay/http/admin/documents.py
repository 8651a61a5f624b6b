"""Response schemas of the page `/admin`, for OpenAPI."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict


class _Document(BaseModel):
    model_config = ConfigDict(extra="forbid")


class RelayFigures(_Document):
    """The relay's counters since its start. `trouble`: its present problem, in one line."""

    trouble: str | None
    viewers: int
    delivered_frames: int
    skipped_frames: int
    refused_publishers: int


class AdminRobot(_Document):
    """A robot in the robots file. `expires_s`: when its credential expires, in unix seconds. `audiences`:
    what each audience can see, in words. `may_link`: whether the file has a rule for share links.

    The last five members need a robot that publishes to this process. `conflict`: two agents publish it.
    `over_share`: the limit that it exceeds, "" for none. `lateness_ms`: how late its frames arrive.
    `sent_views`: the views that it sends. `unsent_views`: by audience, the view that the file shows but the
    robot does not send.
    """

    robot: str
    publishes_by: Literal["credential", "certificate"]
    expires_s: int | None
    audiences: dict[str, str]
    may_link: bool
    has_links: bool
    viewers: int
    status: Literal["online", "silent", "offline"]
    conflict: bool = False
    over_share: str = ""
    lateness_ms: int = 0
    sent_views: list[str] = []
    unsent_views: dict[str, str] = {}


class PastMemory(_Document):
    """Memory that the past uses, and its limit."""

    bytes: int
    bytes_max: int


class ArchiveUse(_Document):
    """The state of the archive. `free_bytes` and `disk_bytes` describe its disk, if it has one."""

    trouble: str | None
    stored_bytes: int
    waiting_bytes: int
    free_bytes: int | None
    disk_bytes: int | None


class AdminReport(_Document):
    """Everything that the page shows. `past` and `archive` are null if none is kept. `certificates`: when
    each expires, in unix seconds, by the flag that names its file."""

    relay: RelayFigures
    robots: list[AdminRobot]
    past: PastMemory | None
    archive: ArchiveUse | None
    certificates: dict[str, int]


class MadeShareLink(_Document):
    """A share link. `link`: all of it with --public-url, else only from # on. `until_s`: unix seconds."""

    link: str
    until_s: int


class Nothing(_Document):
    """An empty answer: the request was carried out."""
