"""Writes the past as MCAP with messages of ROS 2, as Foxglove, PlotJuggler and rosbag2 read it. Needs the
extra `export`."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, BinaryIO

from posecast_wire import Schema
from posecast_wire.checked import loads
from posecast_wire.command_line.installation import advise_extra

from posecast_relay.export import ros_messages as ros
from posecast_relay.export.link_poses import FrameReadings, LinkPose, LinkPoses
from posecast_relay.export.model_tree import ModelTree, ModelTreeError, read_model_tree
from posecast_relay.export.ros_topics import RosTopic, compute_values, list_topics
from posecast_relay.export.table import TableEvent, TableReader, TableRow
from posecast_relay.kit import RecentDict

if TYPE_CHECKING:
    from mcap.writer import Writer

CHUNK_BYTES = 4 << 20  # unpacked: the index of a file, which is in memory, has an entry for each
LIBRARY = "posecast"
WORLD = ("world", "posecast_world")  # the second where a link is called like the first
LEVELS = {"fault": ros.ERROR, "caution": ros.WARN, "info": ros.INFO}
NS_MAX = (1 << 64) - 1  # of MCAP: up to 2554
CHANNELS_MAX = (1 << 16) - 1  # of MCAP: a topic, its type and its units
MODELS_MAX = 8  # whose trees are remembered

FindModel = Callable[[str], bytes | None]


class McapMissingError(RuntimeError):
    """The extra `export` is not installed; the text says how to install it."""


class TooManyTopicsError(ValueError):
    """The schemas of a table differ so much that a file can't have the topics of all; one line."""


def write_mcap(file: BinaryIO, table: TableReader, find_model: FindModel = lambda _: None) -> int:
    """Write the frames and events of a table and return how many frames there are; see
    docs/how-to/record/mcap.md.

    `find_model`: a manifest by its SHA-256, hexadecimal; None where it is not kept. Without one there is no
    /tf, and a line in the table's losses says so. Raises McapMissingError, OSError, TooManyTopicsError.
    """
    try:
        from mcap.writer import CompressionType, Writer  # noqa: PLC0415 — an extra
    except ModuleNotFoundError:
        raise McapMissingError(f"MCAP: not installed; {advise_extra('posecast-relay', 'export')}") from None
    writer = Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
    writer.start(profile="ros2", library=LIBRARY)
    messages = _MessageWriter(writer, table, find_model)
    count = 0
    for found in table.read():
        if isinstance(found, TableRow):
            messages.write_row(found)
            count += 1
        else:
            messages.write_event(found)
    writer.finish()  # type: ignore[no-untyped-call]
    return count


class _MessageWriter:
    """Writes each row and event as messages."""

    def __init__(self, writer: Writer, table: TableReader, find_model: FindModel) -> None:
        self._writer = writer
        self._table = table
        self._find_model = find_model
        self._types: dict[str, int] = {}
        self._channels: dict[tuple[str, str, tuple[tuple[str, str], ...]], int] = {}
        self._counts: dict[int, int] = {}
        self._trees: RecentDict[str, ModelTree | None] = RecentDict(MODELS_MAX)
        self._topics: dict[tuple[str, str | None], list[RosTopic]] = {}  # by schema and root link
        self._readings: tuple[str, FrameReadings] | None = None  # of the newest schema
        self._body: tuple[str, _Transforms] | None = None  # of the newest model

    def write_row(self, row: TableRow) -> None:
        """Write the messages of a frame."""
        unix_ns = 1000 * row.unix_us
        tree = None if row.model is None else self._find_tree(row.model)
        if row.model is not None and tree is not None:
            self._write_transforms(row, row.model, tree)
        values = compute_values(row.parsed, row.codes)
        for topic in self._list_topics(row.schema, row.parsed, tree):
            units = tuple(topic.units.items())
            self._write(topic.name, topic.type_name, unix_ns, topic.fill(unix_ns, values), units)

    def _write_transforms(self, row: TableRow, model: str, tree: ModelTree) -> None:
        if self._readings is None or self._readings[0] != row.schema:
            self._readings = (row.schema, FrameReadings(row.parsed))
        if self._body is None or self._body[0] != model:
            self._body = (model, _Transforms(tree))
        self._readings[1].take(row.codes)
        unix_ns = 1000 * row.unix_us
        data = self._body[1].fill(unix_ns, self._readings[1])
        self._write("/tf", ros.TRANSFORMS, unix_ns, data)

    def write_event(self, event: TableEvent) -> None:
        """Write an event. A robot wrote it: what is not one is left out."""
        try:
            doc = loads(event.text)
        except ValueError:
            return
        if not isinstance(doc, dict):
            return
        level, text = LEVELS.get(str(doc.get("level"))), doc.get("text")
        if level is None or not isinstance(text, str):
            return
        over = doc.get("state") == "off"
        unix_ns = 1000 * event.unix_us
        name = str(doc.get("source", ""))
        data = ros.make_log(unix_ns, ros.INFO if over else level, name, f"{text}: over" if over else text)
        self._write("/rosout", ros.LOG, unix_ns, data)

    def _write(
        self, topic: str, type_name: str, unix_ns: int, data: bytes, units: tuple[tuple[str, str], ...] = ()
    ) -> None:
        key = (topic, type_name, units)
        if key not in self._channels:
            if len(self._channels) >= CHANNELS_MAX:
                raise TooManyTopicsError(f"more than {CHANNELS_MAX} topics: take a shorter span")
            if type_name not in self._types:
                definition = ros.write_definition(type_name)
                self._types[type_name] = self._writer.register_schema(type_name, "ros2msg", definition)
            schema_id = self._types[type_name]
            self._channels[key] = self._writer.register_channel(topic, "cdr", schema_id, dict(units))
        channel = self._channels[key]
        number = self._counts[channel] = self._counts.get(channel, 0) + 1
        unix_ns = min(unix_ns, NS_MAX)
        self._writer.add_message(channel, unix_ns, data, unix_ns, number & 0xFFFFFFFF)

    def _list_topics(self, sha256: str, schema: Schema, tree: ModelTree | None) -> list[RosTopic]:
        key = (sha256, None if tree is None else tree.links[0])
        if key not in self._topics:
            self._topics[key] = list_topics(schema, key[1])
        return self._topics[key]

    def _find_tree(self, model: str) -> ModelTree | None:
        if model not in self._trees:
            tree = None
            manifest = self._find_model(model)
            try:
                tree = None if manifest is None else read_model_tree(manifest)
                reason = "it is not here"
            except ModelTreeError as e:
                reason = str(e)
            if tree is None:
                self._table.losses.add_line(f"no /tf of the model {model[:12]}: {reason}")
            self._trees[model] = tree
        return self._trees[model]


class _Transforms:
    """The message of /tf of one model."""

    def __init__(self, tree: ModelTree) -> None:
        self._poses = LinkPoses(tree)
        world = WORLD[1] if WORLD[0] in tree.links else WORLD[0]
        parents = [world, *(tree.links[joint.parent] for joint in tree.joints)]
        frames = list(zip(parents, tree.links, strict=True))
        self._message, self._places = ros.lay_transforms(frames)
        self._written: list[LinkPose | None] = [None] * len(frames)

    def fill(self, unix_ns: int, readings: FrameReadings) -> bytes:
        """The message at these readings."""
        self._poses.update(readings)
        self._message.set_stamps(unix_ns)
        for i, pose in enumerate(self._poses.poses):
            if pose is not self._written[i]:
                w, x, y, z = pose.quat
                self._message.set_numbers(self._places[i], (*pose.xyz, x, y, z, w))
                self._written[i] = pose
        return bytes(self._message)
