"""All of the relay's limits in one place. Times are in seconds."""

from __future__ import annotations

from dataclasses import dataclass

from posecast_wire import MESSAGE_BYTES_MAX


@dataclass(frozen=True)
class Limits:
    """What the relay accepts, keeps and waits for. The comment at each limit says what happens beyond it."""

    viewers: int = 5000  # in total; the next one gets `bye` 1013
    per_address: int = 2000  # streams; a lecture hall may share one address. The next one gets HTTP 503
    robots: int = 1000  # publishers; frames of any more are dropped and counted
    views: int = 8  # per robot; frames of any more are dropped and counted
    # A robot's share of the relay; beyond it, its own oldest messages are dropped and its status says so
    # (`Share` in `robot.py`).
    view_frames_per_s: float = 120.0
    robot_messages_per_s: float = 600.0  # frames, events and questions together
    robot_bytes_per_s: float = 1e6  # a byte that is hashed counts twice
    robot_events_per_s: float = 200.0  # an edge sends at most 20; each goes to every viewer
    robot_events_burst: float = 600.0  # every fault bit of every joint at once, as in a power failure
    snapshot_bytes_per_s: float = 1 << 19
    snapshot_bytes_burst: float = 1 << 22  # all views of a robot that comes online
    snapshot_bytes: int = 1 << 20  # one answer; a larger one is refused
    schema_bytes_free: int = 1 << 15  # longer schemas count towards `schemas_bytes`
    schemas_bytes: int = 1 << 23  # all robots' long schemas; one too many is refused with its snapshot
    frame_bytes: int = 1 << 16  # a larger frame is dropped and counted
    event_bytes: int = 2048  # a larger event is dropped and counted
    info_bytes: int = 16384  # all of a stream's info; a larger one is refused with its snapshot
    message_bytes: int = MESSAGE_BYTES_MAX  # a viewer's message; longer closes 1009
    max_hz: float = 60.0  # a viewer asking for more gets this
    events: int = 100  # kept per stream for new viewers; the oldest is dropped
    reliable_queue: int = 256  # messages waiting for an undrained viewer; more close it with 4430
    messages_burst: int = 20  # a viewer's messages at once; more close it with 4429
    messages_per_s: float = 10.0
    status_s: float = 0.9  # so that every viewer hears at least once a second
    status_alone_s: float = 0.07  # without a frame to carry it for this long, a status is sent alone
    sweep_s: float = 0.5  # how often to check for silent robots and viewers
    ask_s: float = 1.0  # between two questions for one robot's snapshots
    ack_every_s: float = 1.0  # a viewer owes its next acknowledgement only after this time
    backlog_s: float = 2.0  # acknowledgements arrive, but for messages this old: the next frame is held back
    ack_hold_s: float = 0.9  # owed this long (less than 2 s after the last one): frames are held back
    ack_cut_s: float = 14.0  # owed this long (15 s after the last one): cut with 4409
    # The socket's buffer not drained for this long: cut with 4409.
    undrained_s: float = 5.0  # by a viewer that never acknowledged
    undrained_acking_s: float = 15.0  # by one that acknowledges
    # A new viewer on a link as slow as this needs time for its first data, and the clocks of the other limits
    # wait for it. It proves that it reads by answering the pings between the events; until its first answer
    # they wait only join_burst_s. So a slow reader stays, and one that froze at its first byte is cut after
    # join_burst_s + half_open_s + sweep_s = 19.5 s.
    slowest_bytes_per_s: float = 800.0
    ping_bytes: int = 4000  # between two of those pings: 5 s
    join_burst_s: float = 8.0
    max_age_s: float = float("inf")  # of a connection, ± 10 %; then closed with 4000
    ping_s: float = 5.0  # nothing received for this long: ping
    half_open_s: float = 11.0  # nothing received for this long: cut with 4408, as most frozen pages are
    silent_s: float = 1.5  # a robot whose newest frame is older is silent
    forget_s: float = 3600.0  # a robot that was gone and unwatched for this long is forgotten
