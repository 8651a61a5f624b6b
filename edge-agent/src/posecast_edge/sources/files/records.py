"""The parts of a recording of ROS topics, in any file format, and the order in which its messages are played.

Writers put messages into a file as they like: topic after topic, in chunks that overlap, merged from
several recorders. They are played by the recorder's clock. A file is first scanned for its blocks,
without unpacking them if there is an index. Then each block is read when its time has come, and again if it
has more messages than there is memory for.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from heapq import heapify, heappop, heapreplace
from pathlib import Path
from typing import IO, NamedTuple, Protocol

from posecast_edge.kit import many

UNPACKED_MAX = 64 << 20  # bytes of an unpacked chunk; recorders make chunks of one to sixteen MiB
BLOCK_BYTES = 1 << 20  # smaller chunks, and messages without chunks, are put together
HELD_MAX = 32 << 20  # bytes of the messages that wait for their turn
MESSAGE_BYTES = 250  # that an object for a message takes, beside its data


class RecordedTopic(NamedTuple):
    """A topic of one file. `type_name`: short form; `encoding`: of its messages, `cdr`, `json` or `ros1`."""

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
FindTime = Callable[[RecordedTopic, bytes], int]  # the time in a message, nanoseconds


class RecordedFile(Protocol):
    """A file that has been scanned. `topics`: by their number; `span_ns`: the times of its first and its last
    message, None without messages."""

    topics: dict[int, RecordedTopic]
    span_ns: tuple[int, int] | None

    def read_messages(
        self, wanted: Collection[int], held_max: int, find_ns: FindTime | None = None
    ) -> Iterator[RecordedMessage]:
        """Read the messages of the topics `wanted` by time; those of one time in file order. Holds about
        `held_max` bytes. `find_ns`: gives the times if the recorder's clock stood still. Raises OSError when
        reading fails."""


def ignore(line: str) -> None:
    """Take a line that has been reported before."""


def describe_error(e: Exception) -> str:
    """The problem with a record, in one line of at most 200 characters."""
    return " ".join(str(e).split())[:200] or "it is incomplete"


# --- blocks


@dataclass(slots=True)
class Block:
    """Bytes `begins` to `ends` of a file: a large chunk, or several records. `start_ns`, `end_ns`: the times
    of its first and last message; `topics`: the numbers of their topics. None where only reading it tells.
    `unpacked`: bytes of its messages; `was_read`: what is wrong with it has been reported."""

    begins: int
    ends: int
    unpacked: int = 0
    start_ns: int | None = None
    end_ns: int | None = None
    topics: frozenset[int] | None = None
    was_read: bool = False

    def put_together(self, other: Block) -> None:
        """Extend this block by the next one."""
        self.ends = other.ends
        self.unpacked += other.unpacked
        if self.start_ns is None or self.end_ns is None or other.start_ns is None or other.end_ns is None:
            self.start_ns = self.end_ns = None
        else:
            self.start_ns, self.end_ns = min(self.start_ns, other.start_ns), max(self.end_ns, other.end_ns)
        if self.topics is None or other.topics is None:
            self.topics = None
        elif not other.topics <= self.topics:
            self.topics |= other.topics


def append_block(blocks: list[Block], block: Block) -> None:
    """Add the next block of a file, or put it together with the last one."""
    sizes = (blocks[-1].unpacked + block.unpacked, block.ends - blocks[-1].begins) if blocks else ()
    if blocks and max(sizes) <= BLOCK_BYTES:
        blocks[-1].put_together(block)
    else:
        blocks.append(block)


def complete_blocks(
    blocks: Sequence[Block], topics: dict[int, RecordedTopic], read_block: Callable[[Block], Iterator[Record]]
) -> None:
    """Read those blocks about which the file's index is silent, and those with topics that are not yet in
    `topics`: a topic comes before its first message."""
    met = set(topics)
    for block in blocks:
        if block.start_ns is not None and block.topics is not None and block.topics <= met:
            continue
        times: list[int] = []
        found: set[int] = set()
        for record in read_block(block):
            if isinstance(record, RecordedTopic):
                topics.setdefault(record.id, record)
            else:
                found.add(record.topic_id)
                times = [min((record.t_ns, *times)), max((record.t_ns, *times))]
        if times:
            block.start_ns, block.end_ns = times
        block.topics = frozenset(found) | (block.topics or frozenset())
        block.was_read = True
        met |= topics.keys() | block.topics


def find_span(blocks: Sequence[Block]) -> tuple[int, int] | None:
    """The times of the first and the last message."""
    starts = [block.start_ns for block in blocks if block.start_ns is not None]
    ends = [block.end_ns for block in blocks if block.end_ns is not None]
    return (min(starts), max(ends)) if starts and ends else None


# --- the order

Place = tuple[int, int]  # time, nanoseconds; number of the message in its block
BEFORE_ALL: Place = (-1, 0)


class _Reading:
    """A block while its messages are due. `waiting`: (place, message), the first at the end; `rest`: the
    place of the first message that had to be left in the file."""

    def __init__(self) -> None:
        self.waiting: list[tuple[Place, RecordedMessage]] = []
        self.rest: Place | None = BEFORE_ALL

    @property
    def next_ns(self) -> int | None:
        if self.waiting:
            return self.waiting[-1][0][0]
        return None if self.rest is None else self.rest[0]

    def load(self, messages: Iterator[RecordedMessage], most: int) -> None:
        """Take the first messages from `rest` on, about `most` bytes. None of them if the first is larger and
        not due yet."""
        assert self.rest is not None
        since, before = self.rest, None
        found: list[tuple[Place, RecordedMessage]] = []
        size = 0
        for number, message in enumerate(messages):
            place = (message.t_ns, number)
            if place < since or (before is not None and place >= before):
                continue
            found.append((place, message))
            size += len(message.data) + MESSAGE_BYTES
            if size > 2 * most:
                before = _cut(found, most, since) or before
                size = sum(len(m.data) + MESSAGE_BYTES for _, m in found)
        if size > most:
            before = _cut(found, most, since) or before
        else:
            found.sort(key=_get_place)
        found.reverse()
        self.waiting, self.rest = found, before


def _get_place(found: tuple[Place, RecordedMessage]) -> Place:
    return found[0]


def _cut(found: list[tuple[Place, RecordedMessage]], most: int, due: Place) -> Place | None:
    """Sort and keep the first `most` bytes. Returns the place of the first message that is not kept."""
    found.sort(key=_get_place)
    for i, (place, message) in enumerate(found):
        most -= len(message.data) + MESSAGE_BYTES
        if most < 0 and place != due:
            del found[i:]
            return place
    return None


def read_blocks(
    blocks: Sequence[Block],
    topics: dict[int, RecordedTopic],
    wanted: Collection[int],
    read_block: Callable[[Block], Iterator[Record]],
    held_max: int,
    find_ns: FindTime | None = None,
) -> Iterator[RecordedMessage]:
    """See RecordedFile. `read_block` reads what a block holds, with the data of the wanted messages."""

    def read_wanted(block: Block) -> Iterator[RecordedMessage]:
        for record in read_block(block):
            if isinstance(record, RecordedMessage) and record.topic_id in wanted:
                if find_ns is None:
                    yield record
                else:
                    yield record._replace(t_ns=find_ns(topics[record.topic_id], record.data))
        block.was_read = True

    if find_ns is not None:
        for block in blocks:
            block.start_ns = block.end_ns = None
        complete_blocks(blocks, topics, read_wanted)
    found = [block for block in blocks if not block.topics or not block.topics.isdisjoint(wanted)]
    yield from merge_blocks(found, read_wanted, held_max)


def merge_blocks(
    blocks: Sequence[Block], read_block: Callable[[Block], Iterator[RecordedMessage]], held_max: int
) -> Iterator[RecordedMessage]:
    """Yield the messages of all blocks by time. About `held_max` bytes are held, however many blocks overlap:
    those that have more are read again."""
    share = held_max // max(2, count_overlapping([(b.start_ns or 0, b.end_ns or 0) for b in blocks]))
    queue = [(block.start_ns or 0, i) for i, block in enumerate(blocks)]
    heapify(queue)
    begun: dict[int, _Reading] = {}
    while queue:
        _, i = queue[0]
        one = begun.get(i)
        if one is None or not one.waiting:
            one = begun.setdefault(i, _Reading())
            one.load(read_block(blocks[i]), share)
        else:
            yield one.waiting.pop()[1]
        next_ns = one.next_ns
        if next_ns is None:
            del begun[i]
            heappop(queue)
        else:
            heapreplace(queue, (next_ns, i))


def merge_files(
    files: Sequence[RecordedFile],
    wanted: Sequence[Collection[int]],
    find_ns: FindTime | None,
    complain: Callable[[int, str], None],
) -> Iterator[tuple[int, RecordedMessage]]:
    """Yield the messages of all files by time, each with the number of its file. A file is opened when its
    time has come. `complain` is called with the number of a file and a line."""
    share = HELD_MAX // max(1, count_overlapping([file.span_ns or (0, 0) for file in files]))
    begun: dict[int, Iterator[RecordedMessage]] = {}
    queue = [(0 if file.span_ns is None else file.span_ns[0], i) for i, file in enumerate(files)]
    heapify(queue)
    waiting: dict[int, RecordedMessage] = {}
    late = Counter[int]()
    newest_ns = -(1 << 63)
    while queue:
        _, i = queue[0]
        message = waiting.get(i)
        if message is not None:
            if message.t_ns >= newest_ns:
                newest_ns = message.t_ns
                yield i, message
            else:
                late[i] += 1
        elif i not in begun:
            begun[i] = files[i].read_messages(wanted[i], share, find_ns)
        try:
            following = next(begun[i], None)
        except OSError as e:
            complain(i, f"reading stopped: {e.strerror or e}")
            following = None
        if following is None:
            heappop(queue)
            del begun[i]
            waiting.pop(i, None)
            if late[i]:
                count = many(late[i], "message")
                complain(i, f"{count} can't be put in order, because its index is wrong; left out")
        else:
            waiting[i] = following
            heapreplace(queue, (following.t_ns, i))


def count_overlapping(spans: Sequence[tuple[int, int]]) -> int:
    """How many of these spans (start, end) overlap at most. Two of one time come after each other."""
    ends = sorted((max(span), i) for i, span in enumerate(spans))
    most = ended = 0
    for begun, start in enumerate(sorted((span[0], i) for i, span in enumerate(spans))):
        while ends[ended] < start:
            ended += 1
        most = max(most, begun + 1 - ended)
    return most


class BlockFile:
    """A file of blocks that has been scanned from record to record: one that was cut off, never closed or has
    no index is no exception. A format says how to `_scan` it and to `_read_block`."""

    def __init__(self, path: Path, complain: Complain) -> None:
        """`complain` gets a line for each record that is left out. Raises OSError when reading fails."""
        self.topics: dict[int, RecordedTopic] = {}
        self._path, self._complain = path, complain
        self._blocks: list[Block] = []
        with path.open("rb") as file:
            self._scan(file)
            complete_blocks(self._blocks, self.topics, lambda block: self._read_block(file, block, ()))
        self.span_ns = find_span(self._blocks)

    def read_messages(
        self, wanted: Collection[int], held_max: int, find_ns: FindTime | None = None
    ) -> Iterator[RecordedMessage]:
        """See RecordedFile."""
        with self._path.open("rb") as file:
            yield from read_blocks(
                self._blocks,
                self.topics,
                wanted,
                lambda block: self._read_block(file, block, wanted),
                held_max,
                find_ns,
            )

    def _scan(self, file: IO[bytes]) -> None:
        """Find the blocks, and what the file's index says of them."""
        raise NotImplementedError

    def _read_block(self, file: IO[bytes], block: Block, wanted: Collection[int]) -> Iterator[Record]:
        """The topics of a block, and its messages of the topics that are wanted."""
        raise NotImplementedError
