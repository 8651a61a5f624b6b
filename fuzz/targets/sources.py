"""What an edge reads of robots: lines, tables, recordings, messages; and its profile.

Good samples go all the way to frames and a snapshot.
"""

from __future__ import annotations

import functools
import itertools
import json
from collections.abc import Iterable

from posecast_edge.model.moving_joints import MovingJoint
from posecast_edge.pipeline.inferred_channels import InferredChannels
from posecast_edge.pipeline.intake import TextGuard
from posecast_edge.pipeline.stream import Stream
from posecast_edge.profile.reader import ProfileError, load_profile, parse_profile
from posecast_edge.profile.schema import make_schema_text
from posecast_edge.profile.types import Profile
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.files.csv import Table
from posecast_edge.sources.files.ros_recording import RosRecording
from posecast_edge.sources.files.trajectory import open_source as open_trajectory
from posecast_edge.sources.hubo.ach_shm import AchChannel, ChannelError
from posecast_edge.sources.hubo.achd import AchdParser, AchdProtocolError
from posecast_edge.sources.hubo.state import HuboDecoder, UnknownFrame
from posecast_edge.sources.jsonl import parse_line
from posecast_edge.sources.lines import LineError
from posecast_edge.sources.ros.cdr import CdrReader
from posecast_edge.sources.ros.merge import MessageMerger
from posecast_edge.sources.ros.messages import (
    STRING,
    TF,
    RosMessageError,
    get_text,
    read_message,
    read_transforms,
)
from posecast_edge.sources.ros.robot_frames import JointFrames
from posecast_edge.sources.ros.rosbridge_protocol import MessageAssembler, Publish, RosbridgeProtocolError
from posecast_edge.sources.ros.topics import TYPES, Routes
from posecast_edge.sources.ros.transforms import TransformTree
from posecast_wire import Decoder, SchemaError, Snapshot

from fuzz.scratch import file_of
from fuzz.target import SAID_MAX, Differs, Target

SAMPLES_MAX = 200  # of one case
ROS_TYPES = sorted(TYPES)
LEVEL = (1.0, 0.0, 0.0, 0.0)
ARM = (  # between the frames that the corpus has
    MovingJoint("turn", False, "odom", "base_link", (0, 0, 1), LEVEL, (0, 0, 1), -1, 1),
    MovingJoint("lift", True, "base_link", "leg", (0, 0, 0), LEVEL, (1, 0, 0)),
)
WALK = """
[robot]
name = "walker"
[labels]
joint = ["a", "b", "c"]
[[fields]]
name = "ref"
[[fields]]
name = "pos"
[trajectory]
columns = ["a", "b", "-", "c"]
rate_hz = 100
unit = "deg"
lag_s = 0.01
"""


def hear(line: str) -> None:
    """What is said about bad input: a line that can be shown."""
    if len(line) > SAID_MAX or not line.isprintable():
        raise Differs(f"it says {line[:100]!a}")


def drop(_text: str) -> None:
    """A robot_description that nobody wants."""


def shown(samples: Iterable[Sample], profile: Profile | None = None) -> None:
    """Samples as an agent treats them: the schema of the first, then frames that a decoder reads."""
    stream: Stream | None = None
    shown_as: Profile | None = None
    guard = TextGuard(hear)
    channels = InferredChannels("demo", hear)
    decoder = Decoder()
    for i, sample in enumerate(itertools.islice(samples, SAMPLES_MAX)):
        now_s = i / 30
        sample = guard.clean(sample)  # noqa: PLW2901 - as an agent does
        if profile is None:
            sample = channels.take(sample, now_s)  # noqa: PLW2901
        used = profile or channels.profile
        if used is None:
            continue
        if stream is None:
            stream = Stream(used, 4.0, hear, says_unknown=profile is not None)
        if used is not shown_as:  # once, as an agent does: else a case's cost is that of its schemas
            stream.change_profile(used)
            decoder.add_schema(stream.schema.text)
            shown_as = used
        events = stream.deliver(sample, now_s)
        json.dumps([[e.level, e.source, e.text, e.on] for e in events], ensure_ascii=False).encode()
        frame = stream.tick(now_s)
        if frame is not None and decoder.decode(frame.data).seq != frame.seq:
            raise Differs("a frame reads as another")
    snapshot = stream.make_snapshot(None, SAMPLES_MAX) if stream else None
    if snapshot is not None and Snapshot.unpack(snapshot.pack()) != snapshot:
        raise Differs("a snapshot reads as another")


def jsonl(data: bytes) -> None:
    """Lines."""
    found = []
    refused: LineError | None = None
    for line in data.split(b"\n")[:SAMPLES_MAX]:
        try:
            sample, wrong = parse_line(line, 12.5, "line")
            found.append(sample)
            for text in wrong.values():
                hear(text)
        except LineError as e:
            refused = e
    shown(found)
    if refused is not None:
        raise refused


def csv(data: bytes) -> None:
    """A table."""
    shown(Table(file_of(data, "table.csv"), None).read_samples(0.0, True))


def recording(data: bytes) -> None:
    """A recording, of the format that its first bytes say."""
    played = RosRecording(file_of(data, "recording"), None)
    played.on_urdf = drop
    shown(played.read_samples(0.0, True))


@functools.cache
def walker() -> Profile:
    """A profile for trajectories."""
    return parse_profile(WALK)


def trajectory(data: bytes) -> None:
    """Rows of angles."""
    source = open_trajectory(str(file_of(data, "walk.traj")), walker())
    advance = getattr(source, "advance")  # noqa: B009 - Source promises less
    samples = [advance(i / 100) for i in range(8)]
    getattr(source, "_file").close()  # noqa: B009
    shown([sample for sample in samples if sample is not None], walker())


def profile(data: bytes) -> None:
    """A profile; what is taken makes a schema that says as much."""
    file = file_of(data, "robot.toml")
    found = load_profile(file)
    Stream(found, 4.0, hear)
    make_schema_text(found)


def achd(data: bytes) -> None:
    """A server's bytes, in pieces of as many as the first byte says."""
    conversation, step = AchdParser(), max(1, data[0]) if data else 1
    for at in range(1, len(data), step):
        conversation.feed(data[at : at + step])


def ach(data: bytes) -> None:
    """Shared memory, as a writer that went mad may leave it."""
    channel = AchChannel(file_of(data, "channel"))
    try:
        channel.save_frames()
        for frame in channel.read_new_frames():
            hubo(frame)
    finally:
        channel.close()


def hubo(data: bytes) -> None:
    """A frame of a hubo-ach channel."""
    t_s, values = HuboDecoder(None).decode(data)
    shown([Sample(t_s, {name: values[name] for name in values})])


@functools.cache
def cdr_reader() -> CdrReader:
    """To make one takes a while."""
    return CdrReader()


def cdr(data: bytes) -> None:
    """The first byte says which type, the rest is the message."""
    name = ROS_TYPES[data[0] % len(ROS_TYPES)] if data else STRING
    ros_message(name, cdr_reader().read(name, data[1:]))


def ros_message(name: str, message: object) -> None:
    """A message of any encoding."""
    if name == STRING:
        get_text(message)
        return
    if name == TF:
        tree = TransformTree(("odom", "base_link"), hear)
        for at_s in (1.0, 7.0):
            tree.take_transforms(read_transforms(message)[0], False, at_s)
            tree.check_time(at_s)
        tree.list_frames()
        joints = JointFrames(hear)
        joints.set_joints(ARM)
        for at_s in (1.0, 7.0):
            joints.take_transforms(read_transforms(message)[0], False, at_s)
            joints.check_time(at_s)
        return
    report = read_message(name, message)
    merge = MessageMerger(True, hear)
    merge.take_report("/topic", "pos", name, report, 1.0)
    sample = merge.make_sample(1.0)
    if sample is not None:
        shown([sample])


def rosbridge(data: bytes) -> None:
    """Messages, each on a line if it begins with text; CBOR else."""
    ear, routes = MessageAssembler(), Routes(None)
    text = data[:1] in (b"{", b"[", b'"', b" ", b"\n")
    parts: list[str | bytes] = [*data.decode("utf-8", "replace").split("\n")] if text else [data]
    refused: Exception | None = None
    for part in parts[:SAMPLES_MAX]:
        try:
            heard = ear.feed(part)
            if isinstance(heard, Publish):
                for name in ROS_TYPES:
                    if routes.find_route(heard.topic, name) is not None:
                        ros_message(name, heard.message)
        except (RosbridgeProtocolError, RosMessageError, *DOWNSTREAM) as e:
            refused = e
    if refused is not None:
        raise refused


DOWNSTREAM = (SourceError, SchemaError)  # a first sample that no schema can be made of

TARGETS = (
    Target("jsonl", jsonl, (LineError, *DOWNSTREAM), stretched=1 << 16, ms_per_kb=20),
    Target("csv", csv, DOWNSTREAM, stretched=1 << 17),
    Target("mcap", recording, DOWNSTREAM),
    Target("bag", recording, DOWNSTREAM),
    Target("trajectory", trajectory, DOWNSTREAM, ms_per_kb=20),
    Target("profile", profile, (ProfileError, SchemaError)),
    Target("achd", achd, (AchdProtocolError,)),
    Target("ach", ach, (ChannelError, UnknownFrame, *DOWNSTREAM)),
    Target("hubo", hubo, (UnknownFrame, *DOWNSTREAM)),
    Target("ros-cdr", cdr, (RosMessageError, *DOWNSTREAM)),
    Target("rosbridge", rosbridge, (RosbridgeProtocolError, RosMessageError, *DOWNSTREAM), stretched=1 << 17),
)
