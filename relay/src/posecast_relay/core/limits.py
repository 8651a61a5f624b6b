"""Every bound of the relay in one place. Times in seconds."""

from __future__ import annotations

from dataclasses import dataclass

from posecast_wire import MESSAGE_BYTES_MAX


@dataclass(frozen=True)
class Limits:
    """What the relay takes, keeps and waits for. What happens beyond each bound stands beside it."""

    viewers: int = 5000  # in all; the next one gets `bye` 1013
    per_address: int = 2000  # streams; a lecture hall may stand behind one. The next one gets HTTP 503
    robots: int = 1000  # publishers; frames of further ones are dropped and counted
    views: int = 8  # per robot; likewise
    # A robot's share of the relay; beyond it, its own oldest messages go, and it is told (`share.py`).
    view_frames_per_s: float = 120.0
    robot_messages_per_s: float = 600.0  # frames, events and questions together
    robot_bytes_per_s: float = 1e6  # a byte that is hashed counts twice
    robot_events_per_s: float = 200.0  # an edge sends 20 at most; every viewer is told of each
    robot_events_burst: float = 600.0  # every bit of every joint, as when the power goes
    snapshot_bytes_per_s: float = 1 << 19
    snapshot_bytes_burst: float = 1 << 22  # all views of a robot that comes on air
    snapshot_bytes: int = 1 << 20  # one answer; a larger one is refused
    schema_bytes_free: int = 1 << 15  # a schema that is longer counts among those of all robots
    schemas_bytes: int = 1 << 23  # of those; one that finds no room is refused with its snapshot
    frame_bytes: int = 1 << 16  # a larger frame is dropped and counted
    event_bytes: int = 2048  # a larger event is dropped and counted
    info_bytes: int = 16384  # all of a stream's info; a larger one is refused with its snapshot
    message_bytes: int = MESSAGE_BYTES_MAX  # a viewer's message; longer closes 1009
    max_hz: float = 60.0  # a viewer asking for more gets this
    events: int = 100  # kept per stream for those who join; the oldest goes
    reliable_queue: int = 256  # messages that wait for a viewer that has not drained; beyond closes 4430
    messages_burst: int = 20  # a viewer's messages at once; beyond closes 4429
    messages_per_s: float = 10.0
    status_s: float = 0.9  # so that every viewer hears at least once a second
    status_alone_s: float = 0.07  # no frame for so long that takes the status along: it goes by itself
    sweep_s: float = 0.5  # how often silent robots and silent viewers are looked for
    ask_s: float = 1.0  # between two questions for one robot's snapshots
    ack_every_s: float = 1.0  # a viewer owes no acknowledgement within this of its last
    backlog_s: float = 2.0  # acks come, but for messages so old: send nothing more
    ack_stop_s: float = 0.9  # owed for so long (so less than 2 s after the last one): send nothing more
    ack_abort_s: float = 14.0  # owed for so long (so 15 s after the last one): cut
    undrained_s: float = 5.0  # a viewer that never acknowledges may leave its buffer unread for so long
    undrained_acking_s: float = 15.0  # the same for one that acknowledges
    # A newcomer that reads no faster than this has a while to do with what it is given. It shows that it
    # reads by answering the pings between the events; until the first answer it has join_burst_s alone. So
    # who reads is not cut, and who froze at its first byte is, after join_burst_s + half_open_s + sweep_s
    # = 19.5 s.
    slowest_bytes_per_s: float = 800.0
    ping_bytes: int = 4000  # from one of those pings to the next: 5 s
    join_burst_s: float = 8.0
    max_age_s: float = float("inf")  # of a connection, give or take a tenth; then closed 4000
    ping_s: float = 5.0  # nothing heard for so long: ask
    half_open_s: float = 11.0  # nothing heard for so long: cut
    silent_s: float = 1.5  # a robot whose newest frame is older is silent
    forget_s: float = 3600.0  # a robot that is gone and unwatched for so long is forgotten
