"""Recordings of ROS topics. Source `mcap:PATH`: MCAP files, or the folder that `ros2 bag record` wrote.
Source `bag:PATH`: a bag of ROS 1, or of ROS 2 (its folder or one file). Both names open either: the format is
detected from the content. Needs the extra `mcap`; playback.py plays them.

Reads JointState and the other types of ros/messages.py, in CDR, JSON or ROS 1's encoding. ros/topics.py maps
topics to fields, as for live topics. A file that is cut off is played as far as it goes. An unreadable chunk
or message is logged and left out.
"""

from __future__ import annotations

import itertools
import logging
import re
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from posecast_wire.command_line.installation import advise_extra

from posecast_edge.kit import OnceLog, PartLog, kind_of
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.base import Source
from posecast_edge.sources.files.playback import Playback, Player, parse_playback
from posecast_edge.sources.files.records import Complain, Record, RecordedMessage, RecordedTopic
from posecast_edge.sources.ros.input import TOPICS_MAX
from posecast_edge.sources.ros.merge import SETTLED_S, MessageMerger
from posecast_edge.sources.ros.messages import (
    DESCRIPTION_MAX,
    STRING,
    RosMessageError,
    get_text,
    read_message,
)
from posecast_edge.sources.ros.robot_frames import RobotFrames
from posecast_edge.sources.ros.rosbridge_protocol import MESSAGE_MAX, RosbridgeProtocolError, parse_json
from posecast_edge.sources.ros.topics import STATIC, TOPIC_MAX, TYPES, Route, Routes

try:
    import zstandard

    from posecast_edge.sources.files import mcap_records, rosbag1_records, sqlite_records
    from posecast_edge.sources.ros.cdr import CdrReader, Ros1Reader
except ModuleNotFoundError as e:
    if e.name is None or e.name.startswith("posecast_edge"):
        raise
    raise SourceError(f"mcap and bag: not installed; {advise_extra('posecast-edge', 'mcap')}") from None

if TYPE_CHECKING:
    from posecast_edge.model.moving_joints import MovingJoint
    from posecast_edge.profile.types import Profile

log = logging.getLogger("posecast_edge.recording")

ENCODINGS = ("cdr", "json", "ros1")
NAMED_MAX = 8  # unused topics that are logged
FILES_MAX = 10_000  # of a folder
MODEL_WAIT_S = 60.0  # how long a recording without joint states waits for the model to read its transforms
MAGIC_BYTES = 16
ZSTD = b"\x28\xb5\x2f\xfd"  # start of a compressed message or file; CDR starts with 0
OF_BAG = re.compile(r".+\.(?:mcap|db3|bag)(?:\.zstd)?", re.IGNORECASE)
DIGITS = re.compile(r"\d{1,18}")


def open_mcap(address: str, profile: Profile | None) -> Source:
    """Open the source `mcap`. Raises SourceError without a path, or when the path has no recording."""
    return _open(parse_playback("mcap", address), profile)


def open_bag(address: str, profile: Profile | None) -> Source:
    """Open the source `bag`. Raises SourceError without a path, or when the path has no recording."""
    return _open(parse_playback("bag", address), profile)


def _open(playback: Playback, profile: Profile | None) -> Source:
    return RosRecordingPlayer(RosRecording(playback.path, profile), playback)


class RosRecordingPlayer(Player):
    """Plays one recording and reports which topics it contains (see Discovering)."""

    def __init__(self, recording: RosRecording, playback: Playback) -> None:
        super().__init__(recording, playback)
        self._file = recording

    @property
    def offers(self) -> list[str]:
        """Lines for `probe` about the topics and frames found so far."""
        topics = [f"{topic}  {use}" for topic, use in sorted(self._file.topics.items())]
        return topics + self._file.frames.list_lines()

    def watch_frames(self) -> None:
        """Read /tf even if no profile asks for it, so that `offers` can list its frames."""
        self._file.watched = True

    def take_joints(self, joints: Sequence[MovingJoint]) -> None:
        """Read these joints of the shown model from /tf if there are no joint states."""
        self._file.joints = tuple(joints)
        self._file.joints_known.set()

    def expect_joints(self) -> None:
        """Wait for `take_joints`, at most MODEL_WAIT_S, if joints are only in the transforms."""
        self._file.joints_known.clear()

    def send_urdf_to(self, take: Callable[[str], None]) -> None:
        """Pass a recorded robot_description (URDF text) to `take`."""
        self._file.on_urdf = take


class RosRecording:
    """A recording that is read piece by piece while it plays. `topics`: topic → how it is read."""

    def __init__(self, path: Path, profile: Profile | None) -> None:
        """Raises SourceError (one line) when the path has no recording."""
        self.description = f"recording {path.name}"
        self._path = path
        self._profile = profile
        self._routes = Routes(profile.ros if profile else None)
        self._routes.watch_frames()  # whether they are needed is decided when they arrive
        self.watched = False
        self.joints: Sequence[MovingJoint] | None = None  # of the model that is shown
        self.joints_known = threading.Event()
        self.joints_known.set()
        self.frames = RobotFrames(None, MessageMerger(True, log.warning), log.warning)  # of the newest pass
        self._decoder = _Decoder()
        self._bad = PartLog(log.warning, "bad records")
        self.topics: dict[str, str] = {}
        self.on_urdf: Callable[[str], None] | None = None
        self._files = [path] if not path.is_dir() else list_files(path)
        for file in self._files:
            find_format(file)

    def read_samples(self, start_s: float, first_pass: bool) -> Iterator[Sample]:
        """Read the files once, in their order; see Recording."""
        bad = self._bad if first_pass else None
        one = _Pass(self.topics, self._routes, self._decoder, self._profile, self._find_joints, bad)
        self.frames = one.frames
        if self.watched:
            one.frames.watch()
        began_ns: int | None = None
        begun = start_s == 0
        for file in self._files:
            one.begin_file(str(file))
            for record in read_file(file, one.complain):
                if isinstance(record, RecordedTopic):
                    one.learn(record)
                    continue
                if began_ns is None:
                    began_ns = record.t_ns
                urdf = one.urdf_in(record)
                if urdf is not None:
                    one.frames.joints.set_description(urdf)
                if urdf is not None and first_pass and self.on_urdf is not None:
                    self.on_urdf(urdf)  # it is recorded once, at the start: pass it on with any start time
                begun = begun or (record.t_ns - began_ns) * 1e-9 >= start_s
                if not begun:
                    one.take_static(record)
                else:
                    sample = one.take(record)
                    if sample is not None:
                        yield sample
        if text := one.explain_unread():
            one.warn(text)
        last = one.last()
        if last is not None:
            yield last
        self._bad.flush()

    def _find_joints(self) -> Sequence[MovingJoint] | None:
        """The joints of the shown model, which may still be building; None: use the recording's own
        model."""
        self.joints_known.wait(MODEL_WAIT_S)
        return self.joints


def list_files(folder: Path) -> list[Path]:
    """The files in the folder that `ros2 bag record` wrote, in order of their numbers. Does not need
    metadata.yaml, which is missing if the recorder was killed. Raises SourceError when there is none."""
    try:
        entries = itertools.islice(folder.iterdir(), FILES_MAX)
        found = [path for path in entries if OF_BAG.fullmatch(path.name)]
    except OSError as e:
        raise SourceError(f"{folder}: {e.strerror or e}") from None
    if not found:
        raise SourceError(f"{folder}: no recording in this folder (.mcap, .db3 or .bag)")
    return sorted(found, key=lambda p: ([int(d) for d in DIGITS.findall(p.name)], p.name))


def find_format(path: Path) -> str:
    """`mcap`, `ros1` or `sqlite`, from the first bytes. Raises SourceError, which says what to do."""
    try:
        with path.open("rb") as file:
            head = file.read(MAGIC_BYTES)
    except OSError as e:
        raise SourceError(f"{path}: {e.strerror or e}") from None
    if head.startswith(mcap_records.MAGIC):
        return "mcap"
    if head.startswith(rosbag1_records.MAGIC):
        return "ros1"
    if head.startswith(sqlite_records.MAGIC):
        return "sqlite"
    if head.startswith((b"#ROSBAG", b"#ROSRECORD")):
        raise SourceError(f"{path}: a bag older than version 2.0: convert it with `rosbag fix`")
    if head.startswith(ZSTD):
        raise SourceError(f"{path}: compressed as a whole: unpack it with `zstd -d {path.name}`")
    raise SourceError(f"{path}: neither an MCAP file nor a ROS 1 or ROS 2 bag")


def read_file(path: Path, complain: Complain) -> Iterator[Record]:
    """Read the records of one file. `complain` gets a line about what is left out."""
    try:
        kind = find_format(path)
        if kind == "sqlite":
            yield from sqlite_records.read_sqlite(path, complain)
            return
        with path.open("rb") as file:
            read = mcap_records.read_mcap if kind == "mcap" else rosbag1_records.read_rosbag1
            yield from read(file, complain)
    except SourceError as e:
        complain(str(e))
    except OSError as e:
        complain(f"reading stopped: {e.strerror or e}")


class _Decoder:
    """Decodes messages of any encoding that a recording may have."""

    def __init__(self) -> None:
        self._cdr = CdrReader()
        self._ros1: Ros1Reader | None = None  # made when needed, because it is slow

    def decode(self, encoding: str, type_name: str, data: bytes) -> Any:
        """Decode one message. Raises RosMessageError."""
        if encoding == "cdr":
            return self._cdr.read(type_name, _unpacked(data))
        if encoding == "ros1":
            if self._ros1 is None:
                self._ros1 = Ros1Reader()
            return self._ros1.read(type_name, data)
        if len(data) > MESSAGE_MAX:
            raise RosMessageError(f"a message of {len(data)} bytes is too large")
        try:
            return parse_json(data.decode())
        except UnicodeDecodeError:
            raise RosMessageError("not JSON: not UTF-8") from None
        except RosbridgeProtocolError as e:
            raise RosMessageError(str(e)) from None


def _unpacked(data: bytes) -> bytes:
    """Decompress a message of `ros2 bag record --compression-mode message`."""
    if not data.startswith(ZSTD):
        return data
    try:
        if zstandard.frame_content_size(data) > DESCRIPTION_MAX:
            raise RosMessageError("the message is too large when unpacked")
        return bytes(zstandard.ZstdDecompressor().decompress(data, max_output_size=DESCRIPTION_MAX))
    except (zstandard.ZstdError, MemoryError) as e:
        raise RosMessageError(f"can't be unpacked: {e}") from None


class _Pass:
    """The state of one pass: channels and messages so far. `bad`: None when problems were logged before."""

    def __init__(
        self,
        topics: dict[str, str],
        routes: Routes,
        decoder: _Decoder,
        profile: Profile | None,
        find_joints: Callable[[], Sequence[MovingJoint] | None],
        bad: PartLog | None,
    ) -> None:
        self._routes = routes
        self._decoder = decoder
        self._name = ""  # of the file
        self._bad = bad
        self._merge = MessageMerger(profile is not None, self.warn)
        self.frames = RobotFrames(profile, self._merge, self.warn)
        self._find_joints = find_joints
        self._looked_for_joints = False
        self._channels: dict[int, tuple[RecordedTopic, Route]] = {}  # those that are read
        self._descriptions: dict[int, RecordedTopic] = {}
        self._topics = topics  # topic → how it is read
        self._types: dict[str, str] = {}  # topic → short type
        self._seen: set[int] = set()
        self._ignored = OnceLog(self.warn, NAMED_MAX)
        self._count: dict[str, int] = {}  # messages of a topic
        self._now_s = 0.0  # the recorder's clock
        self._delivered = False

    def begin_file(self, name: str) -> None:
        """Forget topic numbers, which differ from file to file."""
        self._name = name
        for known in (self._channels, self._descriptions, self._seen):
            known.clear()

    def learn(self, record: RecordedTopic) -> None:
        """Take a topic."""
        if record.id in self._seen:
            return
        self._seen.add(record.id)
        type_name, topic = record.type_name, record.topic[:TOPIC_MAX]
        met = topic in self._topics
        if len(self._types) < TOPICS_MAX:
            self._types[topic] = type_name
        route = self._routes.find_route(record.topic, type_name)
        if len(self._topics) < TOPICS_MAX:
            self._topics[topic] = f"{type_name} → {route.role}" if route else f"{type_name}, not read"
        if type_name not in TYPES:
            self._ignore(topic, f"the type {type_name or '(none)'} is not supported", met)
        elif record.encoding not in ENCODINGS:
            self._ignore(topic, f"the encoding {record.encoding[:40]!r} is not supported", met)
        elif route is not None and type_name == STRING:
            self._descriptions[record.id] = record
        elif route is not None:
            if route.role != "tf":
                self._merge.expect_topic(record.topic)
            if route.role == "pos":
                self.frames.expect_states()
            self._channels[record.id] = (record, route)

    def urdf_in(self, message: RecordedMessage) -> str | None:
        """The text of a robot_description."""
        found = self._descriptions.get(message.topic_id)
        if found is None:
            return None
        try:
            return get_text(self._decoder.decode(found.encoding, STRING, message.data))
        except RosMessageError as e:
            self.complain(f"{found.topic}: {e}")
            return None

    def take(self, message: RecordedMessage) -> Sample | None:
        """Take one message; a sample when it completes one."""
        self._now_s = message.t_ns * 1e-9
        known = self._channels.get(message.topic_id)
        if known is None:
            return None
        (_, topic, type_name, encoding), route = known
        if route.role == "tf" and not self._needs_transforms():
            return None
        number = self._count[topic] = self._count.get(topic, 0) + 1
        where = f"{topic}, message {number}"
        try:
            content = self._decoder.decode(encoding, type_name, message.data)
            if route.role == "tf":
                if not self.frames.take_message(content, route.site == STATIC, self._now_s):
                    return None
            else:
                field = "ref" if route.role == "ref" else "pos"
                report = read_message(type_name, content, route.site, field)
                self.frames.note_report(route.role, report)
                self._merge.take_report(topic, route.role, type_name, report, self._now_s)
        except RosMessageError as e:
            self.complain(f"{where}: {e}")
            return None
        sample = self._merge.make_sample(self._now_s)
        self._delivered |= sample is not None
        return None if sample is None else sample._replace(where=f"{self._name}: {where}")

    def _needs_transforms(self) -> bool:
        """Whether /tf messages are needed. Asks for the model the first time that joints need it."""
        if not self._looked_for_joints and self.frames.reads_joints(self._now_s):
            self._looked_for_joints = True
            joints = self._find_joints()
            if joints is not None:
                self.frames.joints.set_joints(joints)
        return self.frames.needs_messages(self._now_s)

    def take_static(self, message: RecordedMessage) -> None:
        """Take a message from before the start: only static transforms count."""
        known = self._channels.get(message.topic_id)
        if known is not None and known[1].site == STATIC and known[1].role == "tf":
            self.take(message)

    def explain_unread(self) -> str:
        """Why there are no positions; "" if there are."""
        return self._routes.explain_unread(self._types)

    def last(self) -> Sample | None:
        """The sample that was still waiting for other topics when the recording ended."""
        self.frames.explain_missing(self._now_s)
        return None if self._delivered else self._merge.make_sample(self._now_s + SETTLED_S)

    def complain(self, text: str) -> None:
        """Log that something can't be read."""
        if self._bad is not None:
            self._bad.add(f"{self._name}: {kind_of(text)}", f"{self._name}: {text}")

    def _ignore(self, topic: str, why: str, met: bool) -> None:
        if not met:  # logged for an earlier file
            self._ignored.add(f"{topic} is ignored: {why}", topic)

    def warn(self, text: str) -> None:
        """Log a line, in the first pass."""
        if self._bad is not None:
            log.warning("%s: %s", self._name, text)
