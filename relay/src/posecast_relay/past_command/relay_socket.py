"""Sends requests to a relay on this machine through the socket that `server/past_socket.py` opens."""

from __future__ import annotations

import os
import socket
from pathlib import Path
from typing import Any

from posecast_wire.checked import loads

from posecast_relay.config.store_url import is_store_url
from posecast_relay.kit import json_bytes

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
