"""What the commands of `posecast-relay past` share: where the past is, moments on the command line, and the
socket of a running relay.
"""

from __future__ import annotations

import argparse
import os
import re
import socket
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from posecast_wire import check_name
from posecast_wire.checked import loads, make_visible

from posecast_relay.archive.store import ObjectStore, open_object_store
from posecast_relay.config.settings import SettingsError
from posecast_relay.config.store_url import StoreUrlError, check_store_url, is_store_url
from posecast_relay.kit import json_bytes


class CommandFailed(Exception):
    """A command failed, or the user answered no. The message is one line with the reason."""


def add_location(parser: argparse.ArgumentParser, environ: Mapping[str, str]) -> None:
    """Add the arguments that locate the past."""
    parser.add_argument(
        "--past",
        metavar="URL",
        default=environ.get("POSECAST_PAST") or "memory:",
        help="URL of the store, as in the relay's --past; memory: is a relay on this machine [POSECAST_PAST]",
    )
    parser.add_argument(
        "--past-socket",
        metavar="PATH",
        type=Path,
        default=environ.get("POSECAST_PAST_SOCKET"),
        help="socket of that relay [POSECAST_PAST_SOCKET, else the only socket in $XDG_RUNTIME_DIR]",
    )


def add_robot(parser: argparse.ArgumentParser, *, required: bool) -> None:
    """Add the arguments that name a robot and a view."""
    parser.add_argument("--robot", metavar="ID", type=read_name, required=required, help="only this robot")
    parser.add_argument("--view", metavar="VIEW", type=read_name, help="only this view")


def open_store(asked: argparse.Namespace) -> ObjectStore | None:
    """Open the store that was named; return None for a relay's memory. Raises SettingsError."""
    if asked.past == "memory:":
        return None
    if asked.past == "0":
        raise SettingsError("--past 0 keeps nothing: give a store's URL, or memory:")
    try:
        url = check_store_url(asked.past)
        return open_object_store(url, makes_folder=False)
    except StoreUrlError as e:
        raise SettingsError(f"--past {asked.past!r}: {e}") from None


def read_name(text: str) -> str:
    """Parse the name of a robot or a view for argparse."""
    try:
        return check_name("name", text)
    except ValueError as e:
        raise argparse.ArgumentTypeError(str(e)) from None


FORM = "use 2026-11-22T14:20 with or without a zone, 14:20 for today, or a date as 2026-11-22"
CLOCK = re.compile(r"([01]?\d|2[0-3]):[0-5]\d(:[0-5]\d(\.\d{1,3})?)?", re.ASCII)
DAY = re.compile(r"\d{4}-\d\d-\d\d", re.ASCII)
MOMENT = re.compile(
    r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d{1,3})?)?(Z|[+-]\d\d:?\d\d)?", re.ASCII | re.IGNORECASE
)
MS_MAX = 253_370_764_800_000  # the year 9999


class TimeError(ValueError):
    """A text is not a time. The message is one line that shows the valid formats."""


def read_moment(text: str, *, is_end: bool = False) -> int:
    """Parse a time and return it in unix ms. Raises TimeError.

    Accepts ISO 8601 (without a zone it is local time), a time of today, or a date. A date means the start of
    that day, or its end with `is_end`.
    """
    if CLOCK.fullmatch(text):
        text = f"{datetime.now().astimezone():%Y-%m-%d}T{text.zfill(len(text) + (text[1] == ':'))}"
    try:
        if DAY.fullmatch(text):
            at = datetime.fromisoformat(text) + timedelta(days=1 if is_end else 0)
        elif MOMENT.fullmatch(text):
            at = datetime.fromisoformat(text.upper())
        else:
            raise TimeError(FORM)
        aware = at if at.tzinfo is not None else at.astimezone()
        unix_ms = (aware - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(milliseconds=1)
    except TimeError:
        raise
    except (ValueError, OverflowError, OSError):
        raise TimeError(f"not a valid time: {FORM}") from None
    if not 0 <= unix_ms <= MS_MAX:
        raise TimeError("use a time in 1970 or later")
    return unix_ms


def read_start(text: str, *, is_end: bool = False) -> int:
    """Parse a time for argparse; a date means the start of that day."""
    try:
        return read_moment(text, is_end=is_end)
    except TimeError as e:
        raise argparse.ArgumentTypeError(f"'{make_visible(text)}': {e}") from None


def read_end(text: str) -> int:
    """Parse a time for argparse; a date means the end of that day."""
    return read_start(text, is_end=True)


def write_moment(unix_ms: int) -> str:
    """Write a time in this machine's zone, to the second, in a form that `read_moment` reads."""
    return datetime.fromtimestamp(min(unix_ms, MS_MAX) // 1000).astimezone().isoformat()


def write_moment_utc(unix_ms: int) -> str:
    """Write a time in UTC, to the second, in a form that `read_moment` reads."""
    return datetime.fromtimestamp(min(unix_ms, MS_MAX) // 1000, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def write_length(ms: int) -> str:
    """Write a duration, to the second: 0:02:05."""
    seconds = (ms + 500) // 1000
    return f"{seconds // 3600}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"


def write_span(from_ms: int, to_ms: int) -> str:
    """Write a time span in this machine's zone, and also in UTC if that differs."""
    local, utc = (f"{write(from_ms)} to {write(to_ms)}" for write in (write_moment, write_moment_utc))
    return utc if local.replace("+00:00", "Z") == utc else f"{local} ({utc})"


PATIENCE_S = 10.0
ANSWER_BYTES_MAX = 64 << 20
OTHER_VERSION = "the relay answers in the format of another version"


class RelayAway(RuntimeError):
    """No relay could be asked. The message is one line with the reason."""


def ask_relay(given: Path | None, question: dict[str, object]) -> dict[str, Any]:
    """Ask a relay, and return its answer. Raises RelayAway."""
    path = given or _find_only()
    try:
        with socket.socket(socket.AF_UNIX) as opened:
            opened.settimeout(PATIENCE_S)
            opened.connect(str(path))
            opened.sendall(json_bytes(question) + b"\n")
            answer = bytearray()
            while part := opened.recv(1 << 16):
                answer += part
                if len(answer) > ANSWER_BYTES_MAX:
                    raise RelayAway(f"{path}: its answer is too long")
    except OSError as e:
        raise RelayAway(f"no relay answers at {path}: {(e.strerror or str(e)).lower()}") from None
    try:
        found = loads(bytes(answer))
    except ValueError:
        raise RelayAway(f"{path}: the program that answered is not a Posecast relay") from None
    if not isinstance(found, dict) or "error" in found:
        why = found.get("error") if isinstance(found, dict) else "no answer"
        raise RelayAway(f"{path}: {why}")
    return found


def find_relay_store(given: Path | None) -> str | None:
    """Return the URL of the store in which a relay also keeps the past; None if it keeps it only in memory.

    Raises RelayAway.
    """
    store = ask_relay(given, {"do": "where"}).get("store")
    if store is not None and not (isinstance(store, str) and is_store_url(store)):
        raise RelayAway(OTHER_VERSION)
    return store


def _find_only() -> Path:
    folder = os.environ.get("XDG_RUNTIME_DIR")
    found = sorted(Path(folder).glob("posecast-relay-*.sock")) if folder else []
    if len(found) == 1:
        return found[0]
    if found:
        raise RelayAway(
            f"several relays run on this machine; name one: --past-socket {' or '.join(map(str, found))}"
        )
    raise RelayAway("give the store (--past URL) or a relay's socket (--past-socket PATH)")
