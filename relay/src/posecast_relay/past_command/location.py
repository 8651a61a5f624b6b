"""Where a command finds the past: in an object store, or in a running relay's memory."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from posecast_wire import check_name

from posecast_relay.archive.object_store import ObjectStore, open_object_store
from posecast_relay.config.settings import SettingsError
from posecast_relay.store_url import StoreUrlError, check_store_url


def add_location(parser: argparse.ArgumentParser, environ: Mapping[str, str]) -> None:
    """Add the arguments that say where the past is."""
    parser.add_argument(
        "--past",
        metavar="URL",
        default=environ.get("POSECAST_PAST") or "memory:",
        help="URL of the store, as the relay's --past; memory: asks a relay on this machine [POSECAST_PAST]",
    )
    parser.add_argument(
        "--past-socket",
        metavar="PATH",
        type=Path,
        default=environ.get("POSECAST_PAST_SOCKET"),
        help="socket of that relay; else the only one in $XDG_RUNTIME_DIR [POSECAST_PAST_SOCKET]",
    )


def add_robot(parser: argparse.ArgumentParser, *, required: bool) -> None:
    """Add the arguments that name a robot and a view."""
    parser.add_argument("--robot", metavar="ID", type=read_name, required=required, help="only this robot")
    parser.add_argument("--view", metavar="VIEW", type=read_name, help="only this view")


def open_store(asked: argparse.Namespace) -> ObjectStore | None:
    """Open the store that was named; None: the past is in a relay's memory. Raises SettingsError."""
    if asked.past == "memory:":
        return None
    if asked.past == "0":
        raise SettingsError("--past 0: keeps nothing; name a store, or memory:")
    try:
        url = check_store_url(asked.past)
        return open_object_store(url, makes_folder=False)
    except StoreUrlError as e:
        raise SettingsError(f"--past {asked.past!r}: {e}") from None


def read_name(text: str) -> str:
    """Read the name of a robot or a view, for argparse."""
    try:
        return check_name("name", text)
    except ValueError as e:
        raise argparse.ArgumentTypeError(str(e)) from None
