"""Source `mcap:PATH`: a recording of ROS topics (the extra `mcap`); playback.py says how it is played.

JointState and the other types of ros/messages.py, in CDR (as `ros2 bag record` writes) or JSON. ros/topics.py
says which topic is read as what, as if they were live. A file that breaks off is played as far as it goes; a
chunk or message that cannot be read is named and left out.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from posecast_edge.rate_limited_log import RateLimitedLog
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.base import Source
from posecast_edge.sources.files.playback import Playback, Player, parse_playback
from posecast_edge.sources.ros.input import TOPICS_MAX
from posecast_edge.sources.ros.merge import SETTLED_S, MessageMerger
from posecast_edge.sources.ros.messages import STRING, RosMessageError, get_text, read_message, shorten_type
from posecast_edge.sources.ros.rosbridge_protocol import MESSAGE_MAX, RosbridgeProtocolError, parse_json
from posecast_edge.sources.ros.topics import TOPIC_MAX, TYPES, Route, Routes

try:
    from mcap.records import Channel, Message, Schema

    from posecast_edge.sources.files.mcap_records import MAGIC, Record, read_records
    from posecast_edge.sources.ros.cdr import CdrReader
except ModuleNotFoundError as e:
    if e.name is None or e.name.startswith("posecast_edge"):
        raise
    raise SourceError("mcap: not installed; pip install 'posecast-edge[mcap]'") from None

if TYPE_CHECKING:
    from posecast_edge.profile.types import Profile

log = logging.getLogger("posecast_edge.mcap")

ENCODINGS = ("cdr", "json")
NAMED_MAX = 8  # topics of no use that are said


def open_source(address: str, profile: Profile | None) -> Source:
    """Open a file. Raises SourceError without a path or when the file is not MCAP."""
    playback = parse_playback("mcap", address)
    return McapPlayer(McapFile(playback.path, profile), playback)


class McapPlayer(Player):
    """Plays one file and reports which topics it contains (see Discovering)."""

    def __init__(self, file: McapFile, playback: Playback) -> None:
        super().__init__(file, playback)
        self._file = file

    @property
    def offers(self) -> list[str]:
        """Lines for `probe` about the topics met so far."""
        return [f"{topic}  {use}" for topic, use in sorted(self._file.topics.items())]

    def send_urdf_to(self, take: Callable[[str], None]) -> None:
        """Pass a recorded robot_description (URDF text) to `take`."""
        self._file.on_urdf = take


class McapFile:
    """An MCAP file that is read chunk by chunk while it plays."""

    def __init__(self, path: Path, profile: Profile | None) -> None:
        self.description = f"mcap {path.name}"
        self._path = path
        self._settled = profile is not None
        self._routes = Routes(profile.ros if profile else None)
        self._cdr = CdrReader()
        self._bad = RateLimitedLog(log.warning, "bad records")
        self.topics: dict[str, str] = {}  # what each is read as
        self.on_urdf: Callable[[str], None] | None = None
        try:
            with self._open() as file:
                is_mcap = file.read(len(MAGIC)) == MAGIC
        except OSError as e:
            raise SourceError(f"{path}: {e.strerror or e}") from None
        if not is_mcap:
            raise SourceError(f"{path}: no MCAP file")

    def read_samples(self, start_s: float, first_pass: bool) -> Iterator[Sample]:
        """Read the file once; see Recording."""
        one = _Pass(
            self.topics,
            self._routes,
            self._cdr,
            self._settled,
            str(self._path),
            self._bad if first_pass else None,
        )
        began_ns: int | None = None
        begun = start_s == 0
        with self._open() as file:
            for record in self._records(file, one.complain):
                if not isinstance(record, Message):
                    one.learn(record)
                    continue
                if began_ns is None:
                    began_ns = record.log_time
                urdf = one.urdf_in(record)
                if urdf is not None and first_pass and self.on_urdf is not None:
                    self.on_urdf(urdf)  # said once, at the beginning: also by who starts later
                begun = begun or (record.log_time - began_ns) * 1e-9 >= start_s
                if begun:
                    sample = one.take(record)
                    if sample is not None:
                        yield sample
        last = one.last()
        if last is not None:
            yield last
        self._bad.flush(time.monotonic())

    def _records(self, file: IO[bytes], complain: Callable[[str], None]) -> Iterator[Record]:
        try:
            yield from read_records(file, complain)
        except OSError as e:
            complain(f"can't be read any more: {e.strerror or e}")

    def _open(self) -> IO[bytes]:
        try:
            return self._path.open("rb")
        except OSError as e:
            raise SourceError(f"{self._path}: {e.strerror or e}") from None


class _Pass:
    """What is known from channels and messages so far. `bad`: None where all has been said already."""

    def __init__(
        self,
        topics: dict[str, str],
        routes: Routes,
        cdr: CdrReader,
        settled: bool,
        name: str,
        bad: RateLimitedLog | None,
    ) -> None:
        self._routes = routes
        self._cdr = cdr
        self._name = name
        self._bad = bad
        self._merge = MessageMerger(settled, self._warn)
        self._schemas: dict[int, str] = {}  # short types
        self._channels: dict[int, tuple[Channel, str, Route]] = {}  # those that are read
        self._descriptions: dict[int, Channel] = {}
        self._topics = topics  # what each is read as
        self._seen: set[int] = set()
        self._ignored = 0  # topics
        self._count: dict[int, int] = {}  # messages of a channel
        self._now_s = 0.0  # the recorder's clock
        self._delivered = False

    def learn(self, record: Schema | Channel) -> None:
        """A schema or channel."""
        if isinstance(record, Schema):
            self._schemas[record.id] = shorten_type(record.name[:TOPIC_MAX])
        elif record.id not in self._seen:
            self._seen.add(record.id)
            type_name = self._schemas.get(record.schema_id, "")
            topic = record.topic[:TOPIC_MAX]
            route = self._routes.find_route(record.topic, type_name)
            if len(self._topics) < TOPICS_MAX:
                self._topics[topic] = f"{type_name} → {route.role}" if route else f"{type_name}, not read"
            if type_name not in TYPES:
                self._ignore(topic, f"nothing here reads {type_name or 'it'}")
            elif record.message_encoding not in ENCODINGS:
                self._ignore(topic, f"{record.message_encoding[:40]!r} is no encoding read here")
            elif route is not None and type_name == STRING:
                self._descriptions[record.id] = record
            elif route is not None:
                self._merge.expect_topic(record.topic)
                self._channels[record.id] = (record, type_name, route)

    def urdf_in(self, message: Message) -> str | None:
        """The text of a robot_description."""
        channel = self._descriptions.get(message.channel_id)
        if channel is None:
            return None
        try:
            return get_text(self._decode(channel.message_encoding, STRING, message.data))
        except RosMessageError as e:
            self.complain(f"{channel.topic}: {e}")
            return None

    def take(self, message: Message) -> Sample | None:
        """One message; a sample when it completes one."""
        self._now_s = message.log_time * 1e-9
        known = self._channels.get(message.channel_id)
        if known is None:
            return None
        channel, type_name, route = known
        number = self._count[channel.id] = self._count.get(channel.id, 0) + 1
        where = f"{channel.topic}, message {number}"
        try:
            content = self._decode(channel.message_encoding, type_name, message.data)
            field = "ref" if route.role == "ref" else "pos"
            report = read_message(type_name, content, route.site, field)
        except RosMessageError as e:
            self.complain(f"{where}: {e}")
            return None
        self._merge.take_report(channel.topic, route.role, type_name, report, self._now_s)
        sample = self._merge.make_sample(self._now_s)
        self._delivered |= sample is not None
        return None if sample is None else sample._replace(where=f"{self._name}: {where}")

    def last(self) -> Sample | None:
        """What a recording that is over while others would still be waited for has to say."""
        return None if self._delivered else self._merge.make_sample(self._now_s + SETTLED_S)

    def complain(self, text: str) -> None:
        """Something can't be read."""
        if self._bad is not None:
            self._bad.add(f"{self._name}: {text}", time.monotonic())

    def _ignore(self, topic: str, why: str) -> None:
        self._ignored += 1
        if self._ignored <= NAMED_MAX:
            more = "; further ones are not said" if self._ignored == NAMED_MAX else ""
            self._warn(f"{topic} is ignored: {why}{more}")

    def _warn(self, text: str) -> None:
        if self._bad is not None:
            log.warning("%s: %s", self._name, text)

    def _decode(self, encoding: str, type_name: str, data: bytes) -> Any:
        if encoding == "cdr":
            return self._cdr.read(type_name, data)
        if len(data) > MESSAGE_MAX:
            raise RosMessageError(f"a message of {len(data)} bytes is too large")
        try:
            return parse_json(data.decode())
        except UnicodeDecodeError:
            raise RosMessageError("not JSON: no UTF-8") from None
        except RosbridgeProtocolError as e:
            raise RosMessageError(str(e)) from None
