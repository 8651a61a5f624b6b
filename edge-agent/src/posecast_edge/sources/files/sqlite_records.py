"""Reads the topics and messages of a ROS 2 bag that is an SQLite database (`.db3`), row after row.

The database is opened read-only, and no code that it defines is run: its two tables must be real tables
without generated columns. Rows are read in the order of recording, so nothing is sorted. Reading a damaged
file whose pages form a loop ends where the loop closes.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from posecast_edge.sources.files.records import (
    Complain,
    Record,
    RecordedMessage,
    RecordedTopic,
    describe_error,
)
from posecast_edge.sources.ros.messages import DESCRIPTION_MAX, shorten_type
from posecast_edge.sources.ros.topics import TOPIC_MAX

MAGIC = b"SQLite format 3\0"
ROW_MAX = DESCRIPTION_MAX + 1024  # bytes of a message; longer ones are images, which are not read
TOPICS_MAX = 1 << 16
STEPS_MAX = 1_000_000  # steps of SQLite's virtual machine between two rows; about twenty are normal
COLUMNS = {
    "topics": ("id", "name", "type", "serialization_format"),
    "messages": ("topic_id", "timestamp", "data"),
}
SAFE = (
    *("query_only = ON", "trusted_schema = OFF", "cell_size_check = ON"),
    *("mmap_size = 0", "cache_size = -2048"),  # kibibytes
)


def read_sqlite(path: Path, complain: Complain) -> Iterator[Record]:
    """Read topics, then messages in the order of recording. `complain` gets a line when rows are left out or
    can't be read."""
    try:
        with closing(
            sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True, check_same_thread=False)
        ) as database:
            database.text_factory = lambda raw: raw.decode("utf-8", "replace")
            for setting in SAFE:
                database.execute(f"PRAGMA {setting}")
            watch = _Watch()
            database.set_progress_handler(watch, STEPS_MAX)
            _check_tables(database)
            yield from _topics(database)
            yield from _messages(database, watch, complain)
    except (sqlite3.Error, sqlite3.Warning, OverflowError, MemoryError) as e:
        complain(f"can't be read{_further(e)}: {describe_error(e)}")
    except ValueError as e:
        complain(describe_error(e))


class _Watch:
    """Ends a query that runs too long without finding a row."""

    def __init__(self) -> None:
        self.rows = 0
        self._rows_before = -1

    def __call__(self) -> bool:
        stuck = self.rows == self._rows_before
        self._rows_before = self.rows
        return stuck


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


def _messages(database: sqlite3.Connection, watch: _Watch, complain: Complain) -> Iterator[RecordedMessage]:
    newest: int | None = None
    for row, topic_id, t_ns, data, size in database.execute(
        "SELECT rowid, topic_id, timestamp, CASE WHEN length(data) <= ? THEN data END, length(data) "
        "FROM messages ORDER BY rowid",
        (ROW_MAX,),
    ):
        if newest is not None and row <= newest:
            raise ValueError(f"its rows form a loop: {row} after {newest}")
        newest = row
        watch.rows += 1
        if isinstance(topic_id, int) and isinstance(t_ns, int) and isinstance(data, bytes):
            yield RecordedMessage(topic_id, t_ns, data)
        elif data is not None or not isinstance(size, int) or size <= ROW_MAX:
            complain(f"row {row} is not a message; left out")
