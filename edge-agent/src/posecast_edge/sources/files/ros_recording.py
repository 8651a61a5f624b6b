"""Recordings of ROS topics. Source `mcap:PATH`: MCAP files, or the folder that `ros2 bag record` wrote.
Source `bag:PATH`: a bag of ROS 1, or of ROS 2 (its folder or one file). Both names open either: the format is
detected from the content. Needs the extra `mcap`; playback.py plays them.

Reads JointState and the other types of ros/messages.py, in CDR, JSON or ROS 1's encoding. ros/topics.py maps
topics to fields, as for live topics. A file that is cut off is played as far as it goes. An unreadable chunk
or message is logged and left out.
"""

from __future__ import annotations

import contextlib
import itertools
import logging
import re
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from posecast_wire.command_line.installation import advise_extra

from posecast_edge.kit import OnceLog, PartLog, kind_of
from posecast_edge.sample import Reading, Sample, SourceError, Values
from posecast_edge.sources.base import Source
from posecast_edge.sources.files.playback import Playback, Player, parse_playback
from posecast_edge.sources.files.recorded_clock import RecordedClock
from posecast_edge.sources.files.records import (
    MESSAGE_BYTES,
    Complain,
    FindTime,
    RecordedFile,
    RecordedMessage,
    RecordedTopic,
    ignore,
    merge_files,
)
from posecast_edge.sources.ros.input import TOPICS_MAX
from posecast_edge.sources.ros.merge import STREAMS, MessageMerger
from posecast_edge.sources.ros.messages import (
    DESCRIPTION_MAX,
    STRING,
    TF,
    Report,
    RosMessageError,
    get_text,
    read_message,
    read_transforms,
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

FILE_TYPES: dict[str, Callable[[Path, Complain], RecordedFile]] = {
    "mcap": mcap_records.McapFile,
    "ros1": rosbag1_records.Rosbag1File,
    "sqlite": sqlite_records.SqliteFile,
}
ENCODINGS = ("cdr", "json", "ros1")
NAMED_MAX = 8  # unused topics that are logged
FILES_MAX = 10_000  # of a folder
MODEL_WAIT_S = 60.0  # how long a recording without joint states waits for the model to read its transforms
AHEAD_NS = 2 * 10**9  # how far a recording is looked ahead for its channels,
AHEAD_BYTES = 8 << 20  # and how far at most
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
        self.frames = RobotFrames(None, RecordedMerger(log.warning), log.warning)  # of the newest pass
        self._decoder = _Decoder()
        self._bad = PartLog(log.warning, "bad records")
        self.topics: dict[str, str] = {}
        self.on_urdf: Callable[[str], None] | None = None
        self._files = [path] if not path.is_dir() else list_files(path)
        for file in self._files:
            find_format(file)

    def read_samples(self, start_s: float, first_pass: bool) -> Iterator[Sample]:
        """Read the files once, by time; see Recording."""
        bad = self._bad if first_pass else None
        one = _Pass(self.topics, self._routes, self._decoder, self._profile, self._find_joints, bad)
        self.frames = one.frames
        if self.watched:
            one.frames.watch()
        messages = self._pass_descriptions_on(one, one.open_files(self._files), first_pass)
        begins_ns: int | None = None
        ahead: list[tuple[int, RecordedMessage]] = []
        size = 0
        for number, message in messages:
            if begins_ns is None:
                begins_ns = (message.t_ns if one.began_ns is None else one.began_ns) + int(start_s * 1e9)
            if start_s and message.t_ns < begins_ns:
                one.take_static(number, message)
                continue
            ahead.append((number, message))
            size += len(message.data) + MESSAGE_BYTES
            if message.t_ns - ahead[0][1].t_ns > AHEAD_NS or size > AHEAD_BYTES:
                break
        one.look_ahead(ahead)
        for number, message in itertools.chain(_emptying(ahead), messages):
            sample = one.take(number, message)
            if sample is not None:
                yield sample
        one.frames.explain_missing(one.now_s)
        self._bad.flush()

    def _pass_descriptions_on(
        self, one: _Pass, messages: Iterator[tuple[int, RecordedMessage]], first_pass: bool
    ) -> Iterator[tuple[int, RecordedMessage]]:
        """The other messages. A description is recorded once, so it is passed on with any start time."""
        for number, message in messages:
            if not one.is_description(number, message):
                yield number, message
                continue
            urdf = one.read_description(number, message)
            if urdf is not None:
                one.frames.joints.set_description(urdf)
                if first_pass and self.on_urdf is not None:
                    self.on_urdf(urdf)

    def _find_joints(self) -> Sequence[MovingJoint] | None:
        """The joints of the shown model, which may still be building; None: use the recording's own
        model."""
        self.joints_known.wait(MODEL_WAIT_S)
        return self.joints


def _emptying(messages: list[tuple[int, RecordedMessage]]) -> Iterator[tuple[int, RecordedMessage]]:
    """The messages, each of which leaves the list."""
    messages.reverse()
    while messages:
        yield messages.pop()


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


def scan_file(path: Path, complain: Complain) -> RecordedFile | None:
    """Find the topics and times of one file. `complain` gets a line about what is left out, now or while
    messages are read. None if the file can't be read."""
    try:
        return FILE_TYPES[find_format(path)](path, complain)
    except SourceError as e:
        complain(str(e).removeprefix(f"{path}: "))
    except OSError as e:
        complain(f"reading stopped: {e.strerror or e}")
    return None


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


class RecordedMerger(MessageMerger):
    """Merges recorded messages, whose robot time comes from a RecordedClock. `lacks_positions`: other
    messages cause samples at once."""

    def __init__(self, say: Callable[[str], None]) -> None:
        super().__init__(True, say)
        self.clock = RecordedClock(say)
        self.lacks_positions = False

    def take_report(self, topic: str, role: str, type_name: str, report: Report, now_s: float) -> None:
        """Take the content of one message, see MessageMerger. `now_s`: by the recorder's clock."""
        self.lacks_positions = self.lacks_positions and role != "pos"
        if role == "pos" or (self.lacks_positions and role in STREAMS):
            labels = tuple(label for readings in report.values.values() for label in readings)
            placed_s = self.clock.place((topic, labels), report.stamp_s, now_s)
            if placed_s != report.stamp_s:
                report = replace(report, stamp_s=placed_s)
        super().take_report(topic, role, type_name, report, now_s)

    def _drives(self, role: str, now_s: float) -> bool:
        return (self.lacks_positions and role in STREAMS) or super()._drives(role, now_s)


class _Pass:
    """The state of one pass: channels and messages so far. `bad`: None when problems were logged before.
    `began_ns`: the time of the recording's first message, of any topic. `now_s`: the recorder's clock."""

    def __init__(
        self,
        topics: dict[str, str],
        routes: Routes,
        decoder: _Decoder,
        profile: Profile | None,
        find_joints: Callable[[], Sequence[MovingJoint] | None],
        bad: PartLog | None,
    ) -> None:
        self.began_ns: int | None = None
        self.now_s = 0.0
        self._routes = routes
        self._decoder = decoder
        self._names: list[str] = []  # of the files
        self._name = ""  # of the newest message's file
        self._bad = bad
        self._merge = RecordedMerger(self._warn)
        self._has_profile = profile is not None
        self.frames = RobotFrames(profile, self._merge, self._warn)
        self._find_joints = find_joints
        self._looked_for_joints = False
        self._channels: dict[
            tuple[int, int], tuple[RecordedTopic, Route]
        ] = {}  # by file and topic: those read
        self._descriptions: dict[tuple[int, int], RecordedTopic] = {}
        self._topics = topics  # topic → how it is read
        self._types: dict[str, str] = {}  # topic → short type
        self._ignored = OnceLog(self._warn, NAMED_MAX)
        self._count: dict[str, int] = {}  # messages of a topic
        # channels that begin soon, without readings, and links of their sites
        self._stands = False  # the recorder's clock
        self._first: tuple[dict[str, dict[str, Reading]], dict[str, str]] | None = None

    def open_files(self, paths: Sequence[Path]) -> Iterator[tuple[int, RecordedMessage]]:
        """Learn the topics of all files and read their messages by time, each with the number of its file."""
        files: list[RecordedFile] = []
        for path in paths:
            self._name = str(path)
            file = scan_file(path, partial(self._complain_of, str(path)))
            if file is not None:
                for topic in file.topics.values():
                    self._learn(len(files), topic)
                files.append(file)
                self._names.append(str(path))
        if text := self._routes.explain_unread(self._types):
            self._warn(text)
        wanted = [
            {topic for number, topic in (*self._channels, *self._descriptions) if number == i}
            for i in range(len(files))
        ]
        spans = [file.span_ns for file in files if file.span_ns is not None]
        find_ns: FindTime | None = None
        if spans and min(spans)[0] == max(end for _, end in spans):
            self._stands = True
            find_ns = partial(self._find_ns, min(spans)[0])
        elif spans:
            self.began_ns = min(spans)[0]
        return merge_files(files, wanted, find_ns, lambda i, text: self._complain_of(self._names[i], text))

    def _find_ns(self, log_ns: int, topic: RecordedTopic, data: bytes) -> int:
        """The timestamp in a message, for a recording whose clock always showed `log_ns`."""
        stamp_s: float | None = None
        with contextlib.suppress(RosMessageError):
            content = self._decoder.decode(topic.encoding, topic.type_name, data)
            if topic.type_name == TF:
                stamp_s = next((one.stamp_s for one in read_transforms(content)[0]), None)
            elif topic.type_name != STRING:
                stamp_s = read_message(topic.type_name, content).stamp_s
        return log_ns if stamp_s is None else int(stamp_s * 1e9)

    def _learn(self, number: int, record: RecordedTopic) -> None:
        """Take a topic of a file."""
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
            self._descriptions[number, record.id] = record
        elif route is not None:
            if route.role == "pos":
                self.frames.expect_states()
            self._channels[number, record.id] = (record, route)

    def is_description(self, number: int, message: RecordedMessage) -> bool:
        """Whether the message is a robot_description. `number`: of the file."""
        return (number, message.topic_id) in self._descriptions

    def read_description(self, number: int, message: RecordedMessage) -> str | None:
        """The text of a robot_description; None if it can't be read."""
        found = self._descriptions[number, message.topic_id]
        try:
            return get_text(self._decoder.decode(found.encoding, STRING, message.data))
        except RosMessageError as e:
            self._complain_of(self._names[number], f"{found.topic}: {e}")
            return None

    def look_ahead(self, messages: Sequence[tuple[int, RecordedMessage]]) -> None:
        """Find out from the first messages which channels there are, for one schema, and whose timestamps are
        useful."""
        if self._stands:
            moves = len(messages) > 1 and messages[0][1].t_ns < messages[-1][1].t_ns
            if moves:
                self._warn("the recorder's clock stood still: the timestamps of the messages are used")
            elif len(messages) > 1:
                self._warn("neither the recorder's clock nor the timestamps advance: only one pose is shown")
        values: dict[str, dict[str, Reading]] = {}
        links: dict[str, str] = {}
        roles: set[str] = set()
        clock = RecordedClock(ignore)
        for number, message in messages:
            known = self._channels.get((number, message.topic_id))
            if known is None:
                continue
            (_, topic, type_name, encoding), route = known
            roles.add(route.role)
            if route.role == "tf":
                continue
            try:
                content = self._decoder.decode(encoding, type_name, message.data)
                report = read_message(type_name, content, route.site, "ref" if route.role == "ref" else "pos")
            except RosMessageError:
                continue  # reported when it is played
            labels = tuple(label for readings in report.values.values() for label in readings)
            clock.place((topic, labels), report.stamp_s, message.t_ns * 1e-9)
            links.update(report.links)
            for name, readings in report.values.items():
                values.setdefault(name, {}).update(dict.fromkeys(readings))
        self._merge.lacks_positions = roles.isdisjoint(("pos", "tf"))
        self._merge.clock.standing |= clock.standing
        self._first = None if self._has_profile else (values, links)

    def take(self, number: int, message: RecordedMessage) -> Sample | None:
        """Take one message; a sample when it completes one. `number`: of the file."""
        self.now_s = message.t_ns * 1e-9
        known = self._channels.get((number, message.topic_id))
        if known is None:
            return None
        self._name = self._names[number]
        (_, topic, type_name, encoding), route = known
        if route.role == "tf" and not self._needs_transforms():
            return None
        count = self._count[topic] = self._count.get(topic, 0) + 1
        where = f"{topic}, message {count}"
        try:
            content = self._decoder.decode(encoding, type_name, message.data)
            if route.role == "tf":
                if not self.frames.take_message(content, route.site == STATIC, self.now_s):
                    return None
            else:
                field = "ref" if route.role == "ref" else "pos"
                report = read_message(type_name, content, route.site, field)
                self.frames.note_report(route.role, report)
                self._merge.take_report(topic, route.role, type_name, report, self.now_s)
        except RosMessageError as e:
            self._complain_of(self._name, f"{where}: {e}")
            return None
        sample = self._merge.make_sample(self.now_s)
        if sample is None:
            return None
        if self._first is not None:
            sample, self._first = _name_channels(sample, *self._first), None
        return sample._replace(where=f"{self._name}: {where}")

    def _needs_transforms(self) -> bool:
        """Whether /tf messages are needed. Asks for the model the first time that joints need it."""
        if not self._looked_for_joints and self.frames.reads_joints(self.now_s):
            self._looked_for_joints = True
            joints = self._find_joints()
            if joints is not None:
                self.frames.joints.set_joints(joints)
        return self.frames.needs_messages(self.now_s)

    def take_static(self, number: int, message: RecordedMessage) -> None:
        """Take a message from before the start: only static transforms count."""
        known = self._channels.get((number, message.topic_id))
        if known is not None and known[1].site == STATIC and known[1].role == "tf":
            self.take(number, message)

    def _complain_of(self, name: str, text: str) -> None:
        """Log that something in a file can't be read."""
        if self._bad is not None:
            self._bad.add(f"{name}: {kind_of(text)}", f"{name}: {text}")

    def _ignore(self, topic: str, why: str, met: bool) -> None:
        if not met:  # logged for an earlier file
            self._ignored.add(f"{topic} is ignored: {why}", topic)

    def _warn(self, text: str) -> None:
        """Log a line, in the first pass."""
        if self._bad is not None:
            log.warning("%s: %s", self._name, text)


def _name_channels(sample: Sample, first: dict[str, dict[str, Reading]], links: dict[str, str]) -> Sample:
    """The sample with these channels, too, without a reading if it lacks them."""
    values: dict[str, Values] = {**first}
    for name, readings in sample.values.items():
        values[name] = {**first.get(name, {}), **readings} if isinstance(readings, Mapping) else readings
    return sample._replace(values=values, links={**links, **sample.links})
