"""Reads the topics and messages of a ROS 2 bag that is an SQLite database (`.db3`), row after row.

The database is opened read-only, and no code that it defines is run: its two tables must be real tables
without generated columns. Reading a damaged file whose pages form a loop ends.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from posecast_edge.sources.files.records import (
    Block,
    Complain,
    FindTime,
    RecordedMessage,
    RecordedTopic,
    describe_error,
    ignore,
    read_blocks,
)
from posecast_edge.sources.ros.messages import DESCRIPTION_MAX, shorten_type
from posecast_edge.sources.ros.topics import TOPIC_MAX

MAGIC = b"SQLite format 3\0"
ROW_MAX = DESCRIPTION_MAX + 1024  # bytes of a message; longer ones are images, which are not read
TOPICS_MAX = 1 << 16
STEPS = 1_000_000  # of SQLite's virtual machine, between two looks
STEPS_PER_ROW = 200  # at most, all queries together; about fifty are normal
ROW_BYTES = 8  # of a file: no row takes less
COLUMNS = {
    "topics": ("id", "name", "type", "serialization_format"),
    "messages": ("topic_id", "timestamp", "data"),
}
SAFE = (
    *("query_only = ON", "trusted_schema = OFF", "cell_size_check = ON"),
    *("mmap_size = 0", "cache_size = -2048"),  # kibibytes
)


class SqliteFile:
    """A database whose topics and times have been read."""

    def __init__(self, path: Path, complain: Complain) -> None:
        """`complain` gets a line when rows are left out or can't be read."""
        self.topics: dict[int, RecordedTopic] = {}
        self.span_ns: tuple[int, int] | None = None
        self._path, self._complain = path, complain
        self._is_readable = False
        with self._reporting(complain), self._open() as database:
            _check_tables(database)
            self.topics = {topic.id: topic for topic in _topics(database)}
            first, last = (
                database.execute(f"SELECT {which}(timestamp) FROM messages").fetchone()[0]
                for which in ("min", "max")
            )
            self._is_readable = True
            if isinstance(first, int) and isinstance(last, int):
                self.span_ns = first, last

    def read_messages(
        self, wanted: Collection[int], held_max: int, find_ns: FindTime | None = None
    ) -> Iterator[RecordedMessage]:
        """See RecordedFile."""
        if find_ns is None:
            yield from self._read_rows(wanted, self._complain)
        else:
            whole = Block(0, 0)
            yield from read_blocks(
                [whole],
                self.topics,
                wanted,
                lambda _: self._read_rows(wanted, ignore if whole.was_read else self._complain),
                held_max,
                find_ns,
            )

    def _read_rows(self, wanted: Collection[int], complain: Complain) -> Iterator[RecordedMessage]:
        if self._is_readable:
            with self._reporting(complain), self._open() as database:
                yield from _messages(database, wanted, complain)

    @contextmanager
    def _open(self) -> Iterator[sqlite3.Connection]:
        """Open the database. Raises sqlite3.Error."""
        address = f"{self._path.resolve().as_uri()}?mode=ro"
        with closing(sqlite3.connect(address, uri=True, check_same_thread=False)) as database:
            database.text_factory = lambda raw: raw.decode("utf-8", "replace")
            for setting in SAFE:
                database.execute(f"PRAGMA {setting}")
            database.set_progress_handler(_Watch(self._path.stat().st_size), STEPS)
            yield database

    @contextmanager
    def _reporting(self, complain: Complain) -> Iterator[None]:
        """End what is done inside when the database can't be read."""
        try:
            yield
        except (sqlite3.Error, sqlite3.Warning, OverflowError, MemoryError) as e:
            complain(f"can't be read{_further(e)}: {describe_error(e)}")
        except ValueError as e:
            complain(describe_error(e))


class _Watch:
    """Ends a query that takes more steps than a sound file of this size can need."""

    def __init__(self, size: int) -> None:
        self._left = 2 + size // ROW_BYTES * STEPS_PER_ROW // STEPS

    def __call__(self) -> bool:
        self._left -= 1
        return self._left < 0


def _further(e: Exception) -> str:
    return " any more" if isinstance(e, sqlite3.DatabaseError) else ""


def _check_tables(database: sqlite3.Connection) -> None:
    """Raise ValueError unless both are plain tables with the columns of a bag."""
    for table, columns in COLUMNS.items():
        found = database.execute("SELECT type, sql FROM sqlite_master WHERE name = ?", (table,)).fetchone()
        made = str(found[1]).split(maxsplit=2)[:2] if found else []
        if not found or found[0] != "table" or [word.upper() for word in made] != ["CREATE", "TABLE"]:
            raise ValueError(f"has no table {table!r}: not a ROS 2 bag")
        rows = database.execute("SELECT name, hidden FROM pragma_table_xinfo(?)", (table,)).fetchmany(100)
        plain = {name for name, hidden in rows if hidden == 0}
        if lacks := [name for name in columns if name not in plain]:
            raise ValueError(f"its table {table!r} has no column {lacks[0]!r}: not a ROS 2 bag")


def _topics(database: sqlite3.Connection) -> Iterator[RecordedTopic]:
    for number, name, type_name, encoding in database.execute(
        "SELECT id, substr(name, 1, ?1), substr(type, 1, ?1), substr(serialization_format, 1, ?1) "
        "FROM topics LIMIT ?2",
        (TOPIC_MAX + 1, TOPICS_MAX),
    ):
        if isinstance(number, int) and isinstance(name, str) and isinstance(type_name, str):
            yield RecordedTopic(number, name, shorten_type(type_name), str(encoding))


def _messages(
    database: sqlite3.Connection, wanted: Collection[int], complain: Complain
) -> Iterator[RecordedMessage]:
    """The order comes from the bag's index of times. Without one, SQLite sorts the times, in a temporary file
    when they are many."""
    numbers = ", ".join(str(int(number)) for number in wanted)
    one = f"""
        SELECT topic_id, CASE WHEN topic_id IN ({numbers}) AND length(data) <= {ROW_MAX} THEN data END,
        length(data) FROM messages WHERE rowid = ?
        """
    newest: tuple[int, int] | None = None
    for row, t_ns in database.execute("SELECT rowid, timestamp FROM messages ORDER BY timestamp, rowid"):
        topic_id, data, size = database.execute(one, (row,)).fetchone() or (None, None, 0)
        if not isinstance(t_ns, int) or not isinstance(topic_id, int):
            complain(f"row {row} is not a message; left out")
            continue
        if newest is not None and (t_ns, row) <= newest:
            raise ValueError(f"its rows form a loop: {row} after {newest[1]}")
        newest = t_ns, row
        if topic_id not in wanted:
            continue
        if isinstance(data, bytes):
            yield RecordedMessage(topic_id, t_ns, data)
        elif data is not None or not isinstance(size, int) or size <= ROW_MAX:
            complain(f"row {row} is not a message; left out")
