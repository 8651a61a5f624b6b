"""Source `mcap:PATH`: MCAP files, or the folder that `ros2 bag record` wrote; ros_recording.py reads them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from posecast_edge.sources.base import Source
from posecast_edge.sources.files.playback import parse_playback
from posecast_edge.sources.files.ros_recording import RosRecording, RosRecordingPlayer

if TYPE_CHECKING:
    from posecast_edge.profile.types import Profile


def open_source(address: str, profile: Profile | None) -> Source:
    """Open a recording. Raises SourceError without a path, or when the path has no recording."""
    playback = parse_playback("mcap", address)
    return RosRecordingPlayer(RosRecording(playback.path, profile), playback)
