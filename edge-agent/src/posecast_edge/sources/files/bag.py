"""Source `bag:PATH`: a bag of ROS 1, or of ROS 2 (its folder or one file); ros_recording.py reads them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from posecast_edge.sources.base import Source
from posecast_edge.sources.files.playback import parse_playback
from posecast_edge.sources.files.ros_recording import RosRecording, RosRecordingPlayer

if TYPE_CHECKING:
    from posecast_edge.profile.types import Profile


def open_source(address: str, profile: Profile | None) -> Source:
    """Open a recording. Raises SourceError without a path, or when the path has no recording."""
    playback = parse_playback("bag", address)
    return RosRecordingPlayer(RosRecording(playback.path, profile), playback)
