"""The link to a robot: its text, its QR code, and a browser that opens it."""

from __future__ import annotations

import io
import ipaddress
import socket
import sys
import webbrowser
from collections.abc import Mapping
from contextlib import suppress

EVERYWHERE = ("0.0.0.0", "::")


def find_lan_address() -> str:
    """The address at which other machines reach this one: the source address of the default route. Sends
    nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # TEST-NET-1: only picks a route
            return str(probe.getsockname()[0])
        except OSError:
            return "127.0.0.1"


def name_host(host: str) -> str:
    """The host to put into a link that other machines open, for a relay that listens on `host`."""
    shown = find_lan_address() if host in EVERYWHERE else host
    return f"[{shown}]" if ":" in shown else shown


def name_local_host(host: str) -> str:
    """The host to put into a link that this machine opens, for a relay that listens on `host`."""
    local = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)
    return f"[{local}]" if ":" in local else local


def is_for_others(host: str) -> bool:
    """Whether other machines can reach a server that listens on `host`."""
    try:
        return not ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host != "localhost"


def draw_qr(url: str, encoding: str) -> str:
    """The link as a QR code for a terminal; "" if the terminal's encoding lacks the characters."""
    import segno  # noqa: PLC0415 - only for the phone

    out = io.StringIO()
    segno.make(url, error="l").terminal(out, compact=True)
    code = out.getvalue()
    try:
        code.encode(encoding)
    except UnicodeEncodeError:
        return ""
    return code


def has_browser(environment: Mapping[str, str], platform: str = sys.platform) -> bool:
    """Whether the user is likely to see a browser window opened on this machine."""
    if any(environment.get(name) for name in ("CI", "SSH_CONNECTION", "SSH_TTY")):
        return False
    if platform.startswith(("darwin", "win")):
        return True
    return any(environment.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def open_browser(url: str) -> None:
    """Open the link if possible."""
    with suppress(webbrowser.Error, OSError):  # the link is also printed
        webbrowser.open(url)
