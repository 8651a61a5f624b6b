"""The parts of a recording of ROS topics, in any file format."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

UNPACKED_MAX = 64 << 20  # bytes of an unpacked chunk; recorders make chunks of one to sixteen MiB


class RecordedTopic(NamedTuple):
    """A topic of one file, which comes before its first message. `type_name`: short form; `encoding`: of its
    messages, `cdr`, `json` or `ros1`."""

    id: int
    topic: str
    type_name: str
    encoding: str


class RecordedMessage(NamedTuple):
    """One message. `t_ns`: the recorder's clock, nanoseconds."""

    topic_id: int
    t_ns: int
    data: bytes


Record = RecordedTopic | RecordedMessage
Complain = Callable[[str], None]  # takes a line about what can't be read


def describe_error(e: Exception) -> str:
    """The problem with a record, in one line of at most 200 characters."""
    return " ".join(str(e).split())[:200] or "it is incomplete"
