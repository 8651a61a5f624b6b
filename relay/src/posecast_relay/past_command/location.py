"""Tells a command where the past is: in an object store, or in a running relay's memory."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from posecast_wire import check_name

from posecast_relay.archive.object_store import ObjectStore, open_object_store
from posecast_relay.config.settings import SettingsError
from posecast_relay.config.store_url import StoreUrlError, check_store_url


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
