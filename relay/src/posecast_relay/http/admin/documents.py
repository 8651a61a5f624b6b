"""The JSON documents of the page `/admin`, for the description of the API."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict


class _Document(BaseModel):
    model_config = ConfigDict(extra="forbid")


class RelayFigures(_Document):
    """What the relay has done since it started. `trouble`: what is wrong with it, in a line; `previews`: the
    viewers of small pictures, which are not among `viewers`."""

    trouble: str | None
    viewers: int
    previews: int
    delivered_frames: int
    skipped_frames: int
    refused_publishers: int


class AdminRobot(_Document):
    """A robot of the file. `expires_s`: when its credential does, unix seconds; `audiences`: what each may
    see, in words; `may_link`: whether the file has a rule for share links. The last five are of a robot
    that this process hears: whether two agents claim it, which limit of its share it exceeds ("" for none),
    how late its frames come, which views it sends, and by audience the views that the file shows but the
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
    """What the past in memory takes, and may take."""

    bytes: int
    bytes_max: int


class ArchiveUse(_Document):
    """The state of the archive. `free_bytes` and `disk_bytes` are of its disk, where it has one."""

    trouble: str | None
    stored_bytes: int
    waiting_bytes: int
    free_bytes: int | None
    disk_bytes: int | None


class AdminReport(_Document):
    """All that the page shows. `past` and `archive`: null where none is kept; `certificates`: when each
    expires, unix seconds by the flag that names it."""

    relay: RelayFigures
    robots: list[AdminRobot]
    past: PastMemory | None
    archive: ArchiveUse | None
    certificates: dict[str, int]


class MadeShareLink(_Document):
    """A share link. `link`: all of it with --public-url, else from # on; `until_s`: unix seconds."""

    link: str
    until_s: int


class Nothing(_Document):
    """An answer that says only that it is done."""
