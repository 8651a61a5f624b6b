"""What docs/ROBOTS.md says of profiles and sources is so; test_source_doctor.py looks at the findings."""

from __future__ import annotations

import re
from pathlib import Path

from posecast_edge.profile_reader import SHIPPED, parse_profile
from posecast_edge.schema_build import schema_text
from posecast_edge.sources import KINDS
from posecast_edge.sources.hubo_state import LAYOUTS
from posecast_edge.sources.ros2 import BACKLOG_MAX, PAYLOAD_MAX
from posecast_edge.sources.ros_merge import STATE_S, STREAM_S
from posecast_edge.sources.ros_topics import ROLES, TYPES
from posecast_edge.sources.rosbridge import LOOK_S, THROTTLE_MS
from posecast_edge.wellknown import UNITS
from posecast_wire.schema import Schema

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "ROBOTS.md").read_text(encoding="utf-8")


def test_the_profile_on_the_page_is_one() -> None:
    _, text = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    profile = parse_profile(text)
    Schema.parse(schema_text(profile))
    for view in profile.views.values():
        Schema.parse(schema_text(profile.seen_as(view)))
    assert set(profile.views) == {"public", "lab"}
    assert profile.mapping.joints["knuckle2"].terms == (("RF1", 0.8),)


def test_the_topics_on_the_page_are_a_table_of_a_profile() -> None:
    text, _ = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    ros = parse_profile('[[fields]]\nname = "pos"\nlabels = ["a"]\n' + text).ros
    assert ros is not None
    assert set(ros.topics) == set(ROLES)
    assert ros.topics["wrench"] == (("/ft/right", "RF"), ("/ft/left", "LF"))
    assert (ros.domain, ros.encoding) == (0, "json")


def test_every_ros_type_is_on_it() -> None:
    assert [name for name in TYPES if f"`{name}`" not in PAGE] == []
    assert (STREAM_S, STATE_S, PAYLOAD_MAX, BACKLOG_MAX) == (1.5, 60, 256 << 10, 4 << 20)
    assert [
        words for words in ("1.5 s", "60 s", "256 KiB", "4 MiB", "again every 10 s") if words not in PAGE
    ] == []
    assert (THROTTLE_MS, LOOK_S) == (15, 10)
    assert "`throttle_rate: 15` with `queue_length: 1`" in PAGE


def test_every_source_unit_profile_and_version_is_on_it() -> None:
    assert [kind for kind in KINDS if f"`{kind}" not in PAGE] == []
    assert [unit for unit in set(UNITS.values()) if unit and unit not in PAGE] == []
    assert [path.stem for path in SHIPPED.glob("*.toml") if f"`{path.stem}`" not in PAGE] == []
    assert [size for size in LAYOUTS if str(size) not in PAGE] == []
