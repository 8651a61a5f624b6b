"""Reads a profile's [ros] table: which topics are read, and in which role."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from posecast_edge.kit import quote
from posecast_edge.profile.types import RosTopics

if TYPE_CHECKING:
    from posecast_edge.profile.reader import ProfileReader

ROLES = ("pos", "ref", "imu", "wrench", "battery", "diagnostics", "base", "description")
SITED = ("imu", "wrench", "battery")  # roles whose topics may be given a site
ENCODINGS = ("json", "cbor")  # of rosbridge
PATTERN = re.compile(r"(?:/(?:\*\*|[A-Za-z0-9_*]+))+")
SITE = re.compile(r"[^.\s/]+")
ARROW = re.compile(r"→|->")
FRAME = re.compile(r"\S{1,200}")
DOMAIN_MAX = 232  # ROS 2's


def read_ros(reader: ProfileReader, value: object) -> RosTopics:
    """Parse the table. Raises ProfileError, which names the line."""
    item = reader.check_table(value, "ros", (*ROLES, "domain", "encoding"))
    domain = reader.check_integer(item["domain"], "ros.domain", 0, DOMAIN_MAX) if "domain" in item else None
    encoding = reader.check_choice(item.get("encoding", "json"), ENCODINGS, "encoding", "ros.encoding")
    frames = _frames(reader, item["base"]) if "base" in item else None
    given = [role for role in ROLES if role in item and not (frames and role == "base")]
    topics = {role: _patterns(reader, item[role], role) for role in given}
    return RosTopics(topics, domain, frames, encoding)


def _frames(reader: ProfileReader, value: object) -> tuple[str, str] | None:
    """The two frames of `odom→base_link` or `odom->base_link`; None for topic names."""
    if not isinstance(value, str) or not ARROW.search(value):
        return None
    names = [name.strip().strip("/") for name in ARROW.split(value)]
    if len(names) != 2 or not all(FRAME.fullmatch(name) for name in names) or names[0] == names[1]:
        reader.fail("ros.base", f"{quote(value)} is not a pair of frames such as odom→base_link")
    return names[0], names[1]


def _patterns(reader: ProfileReader, value: object, role: str) -> tuple[tuple[str, str], ...]:
    """Parse `"/a"`, `["/a", "/b/*"]`, `[]` for none, or for a sensor `{ site = "/a" }`."""
    where = f"ros.{role}"
    if isinstance(value, dict) and role in SITED:
        for site in value:
            if not SITE.fullmatch(site):
                reader.fail(f"{where}.{site}", "a site must be one word without a dot")
        return tuple((_pattern(reader, text, f"{where}.{site}"), site) for site, text in value.items())
    listed = value if isinstance(value, list) else [value]
    return tuple((_pattern(reader, text, where), "") for text in listed)


def _pattern(reader: ProfileReader, value: object, where: str) -> str:
    text = reader.check_text(value, where)
    if not PATTERN.fullmatch(text):
        reader.fail(where, f"{quote(text)} is not a topic such as /joint_states, /arm/*/state or /**/imu")
    return text
