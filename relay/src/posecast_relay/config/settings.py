"""Reads flags and POSECAST_* variables once, into one frozen object. A flag overrides a variable."""

from __future__ import annotations

import ipaddress
import re
from argparse import SUPPRESS
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import NoReturn, TypeVar

from posecast_wire.command_line.parser import CommandParser

from posecast_relay.auth.addresses import ORIGIN, Network, parse_networks
from posecast_relay.config.store_url import StoreUrlError, check_store_url

PACKAGE = Path(__file__).resolve().parents[1]
CHECKOUT = PACKAGE.parents[2]  # if this package is installed from a checkout
PLACES = (PACKAGE / "page", CHECKOUT / "spa/dist")  # a wheel contains the page


def find_page(places: Sequence[Path] = PLACES) -> Path | None:
    """Return the folder of the built page: in this package, else in the checkout; None without either."""
    return next((place for place in places if (place / "index.html").is_file()), None)


T = TypeVar("T")

STATUSES = {
    0: "success, or stopped by SIGTERM or Ctrl-C",
    1: "a command failed",
    2: "wrong arguments, or a port in use",
}
STORES = ["memory", "redis", "rediss", "redis+cluster"]  # schemes of `--store`; see server/roles.py
_file = Path  # it need not exist or be readable yet: the relay waits for it
MEMORY = "memory:"  # a value of `--past`: keep the past in memory only


class SettingsError(ValueError):
    """A setting is invalid. The message is one line that names it."""


class StartError(RuntimeError):
    """The relay can't start. The message is one line with the reason."""


@dataclass(frozen=True)
class Settings:
    """The settings of `posecast-relay run`. FLAGS explains each field and its unit."""

    dev: bool
    role: str
    host: str
    port: int
    metrics_port: int | None
    store: str
    zenoh_listen: tuple[str, ...]
    zenoh_tls_cert: Path | None
    zenoh_tls_key: Path | None
    zenoh_ca: Path | None
    robots: Path | None
    origins: tuple[str, ...]
    trusted_proxies: tuple[Network, ...]
    firebase_project: str | None
    firebase_revoked: bool
    firebase_database: str | None
    static: Path | None
    public_url: str | None
    max_viewers: int
    max_per_address: int
    max_robots: int
    max_view_frames: int
    max_robot_messages: int
    max_robot_bytes: int
    max_connection_age: float | None
    model_cache_mb: int
    past: str | None
    past_memory: int
    past_socket: Path | None
    log_level: str

    @property
    def archive(self) -> str | None:
        """The URL of the object store that keeps the past; None without one."""
        return None if self.past in (None, MEMORY) else self.past

    @property
    def uses_redis(self) -> bool:
        """Whether the store is a Redis."""
        return self.store.startswith("redis")


def _boolean(text: str) -> bool:
    if text.lower() in ("1", "true", "yes", "on"):
        return True
    if text.lower() in ("", "0", "false", "no", "off"):
        return False
    raise ValueError("use 1 or 0")


def _number(least: int, most: int, of: str = "") -> Callable[[str], int]:
    def read(text: str) -> int:
        if not text.isascii() or not text.isdigit() or len(text) > 13 or not least <= int(text) <= most:
            raise ValueError(f"use a number{of} from {least} to {most}")
        return int(text)

    return read


_port = _number(0, 65535)
_count = _number(1, 1_000_000)
_bytes = _number(10_000, 1_000_000_000, " of bytes")
_seconds = _number(1, 1_000_000, " of seconds")


def _one_of(*words: str) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text not in words:
            raise ValueError(f"use {', '.join(words[:-1])} or {words[-1]}")
        return text

    return read


_role = _one_of("all", "ingest", "gateway")
_level = _one_of("debug", "info", "warning", "error")


def _past(text: str) -> str | None:
    if text in (MEMORY, "0"):
        return None if text == "0" else text
    try:
        return check_store_url(text)
    except StoreUrlError as e:
        told = str(e)
        if not told.startswith("use "):  # it tells what to write instead
            raise ValueError(told) from None
        raise ValueError(f"use memory: or 0, or for an object store {told.removeprefix('use ')}") from None


def _memory(text: str) -> int:
    found = re.fullmatch(r"(\d{1,9})([MG])", text, re.ASCII)
    size = int(found[1]) << (30 if found[2] == "G" else 20) if found else 0
    if not 16 << 20 <= size <= 1 << 40:
        raise ValueError("use a size from 16M to 1024G; the suffix is M or G")
    return size


def _socket(text: str) -> Path:
    if len(text.encode()) > 100 or not Path(text).parent.is_dir():  # Unix takes 107 bytes
        raise ValueError("use a path of at most 100 bytes in an existing folder")
    return Path(text)


def _host(text: str) -> str:
    if not text or any(c.isspace() or c == "/" for c in text):
        raise ValueError("use a host name or address")
    return text


def _store(text: str) -> str:
    scheme, _, place = text.partition("://")
    if scheme not in STORES or not (text == "memory://" or re.match(r"\S+$", place)):
        raise ValueError("use memory://, redis://HOST:PORT, rediss://… (TLS) or redis+cluster://…")
    return text


def _endpoints(text: str) -> tuple[str, ...]:
    found = tuple(part.strip() for part in text.split(","))
    for part in found:
        if (
            not re.fullmatch(r"(tcp|tls|quic)/(\[[0-9a-fA-F:]+\]|[^\s:/#?]+):\d{1,5}", part)
            or int(part[-5:].split(":")[-1]) > 65535
        ):
            raise ValueError("use tls/HOST:PORT or tcp/HOST:PORT, separated by commas")
    return found


def _directory(text: str) -> Path:
    path = Path(text)
    if not (path / "index.html").is_file():
        raise ValueError("use a folder that contains index.html")
    return path


def _proxies(text: str) -> tuple[Network, ...]:
    try:
        return parse_networks(text)
    except ValueError:
        raise ValueError("use addresses or networks like 10.0.0.0/8, separated by commas") from None


def _project(text: str) -> str:
    if not re.fullmatch(r"[a-z][a-z0-9-]{3,62}", text):
        raise ValueError("use the project's id, for example my-course-1a2b")
    return text


def _database(text: str) -> str:
    found = re.fullmatch(r"(https?)://([a-zA-Z0-9.-]+|\[[0-9a-fA-F:]+\])(:\d{1,5})?/?", text)
    if found is None or (found[1] == "http" and not _is_loopback(f"/{found[2]}:0")):
        raise ValueError("use https://HOST from the Firebase console; http:// only for this machine")
    return text.rstrip("/")


def _origins(text: str) -> tuple[str, ...]:
    found = tuple(part.strip() for part in text.split(",") if part.strip())
    for part in found:
        if not ORIGIN.fullmatch(part):
            raise ValueError("use origins like https://HOST[:PORT], separated by commas")
    return found


def _public_url(text: str) -> str:
    found = re.fullmatch(r"(https?://[^/?#]+)((?:/[A-Za-z0-9._~-]+)*)/?", text)
    if found is None or not ORIGIN.fullmatch(found[1]):
        raise ValueError("use the page's address, for example https://posecast.example or https://HOST/path")
    return found[1] + found[2]


@dataclass(frozen=True)
class _Flag:
    name: str  # the field in Settings
    read: Callable[[str], object]
    default: str | None
    help: str
    metavar: str | None = None  # None: a switch
    also: str | None = None  # another variable, which POSECAST_* overrides

    @property
    def option(self) -> str:
        return "--" + self.name.replace("_", "-")

    @property
    def variable(self) -> str:
        return "POSECAST_" + self.name.upper()


FLAGS = (
    _Flag("dev", _boolean, "", "accept robots without credentials, from this machine only"),
    _Flag("role", _role, "all", "all; ingest: robots to Redis; gateway: Redis to viewers", "ROLE"),
    _Flag("host", _host, "127.0.0.1", "address for HTTP", "HOST"),
    _Flag("port", _port, "8080", "port for HTTP; 0 for any free port", "PORT", "PORT"),
    _Flag("metrics_port", _port, None, "port for Prometheus metrics, on --host; off by default", "PORT"),
    _Flag("store", _store, "memory://", "memory://, redis://, rediss:// (TLS), redis+cluster://…", "URL"),
    _Flag("zenoh_listen", _endpoints, "tcp/127.0.0.1:7447", "where robots connect", "ADDR"),
    _Flag("zenoh_tls_cert", _file, None, "certificate for tls/… endpoints (PEM)", "FILE"),
    _Flag("zenoh_tls_key", _file, None, "private key of that certificate (PEM)", "FILE"),
    _Flag("zenoh_ca", _file, None, "authority of robots' certificates (PEM); no passwords then", "FILE"),
    _Flag("robots", _file, None, "who can publish and watch; edit it with `posecast-relay robots`", "FILE"),
    _Flag("origins", _origins, "", "other sites whose pages may show robots that are not public", "URL,…"),
    _Flag("trusted_proxies", _proxies, "", "your proxies; their X-Forwarded-For is believed", "NET,…"),
    _Flag("firebase_project", _project, None, "Firebase project whose accounts are `signed-in`", "ID"),
    _Flag("firebase_revoked", _boolean, "", "ask Google about revoked accounts (service account)"),
    _Flag("firebase_database", _database, None, "mirror there what anyone can see, at 2 Hz", "URL"),
    _Flag("static", _directory, None, "the built page (default: packaged; in a checkout spa/dist)", "DIR"),
    _Flag("public_url", _public_url, None, "where people open the page; link previews need it", "URL"),
    _Flag("max_viewers", _count, "5000", "viewers at once; the next is told `full`", "N"),
    _Flag("max_per_address", _count, "2000", "streams from one address, such as a lecture hall", "N"),
    _Flag("max_connection_age", _seconds, None, "close streams after about S seconds; they reconnect", "S"),
    _Flag("max_robots", _count, "1000", "robots at once; frames of further ones are dropped", "N"),
    _Flag("max_view_frames", _count, "120", "frames a second of one view; the rest are dropped", "N"),
    _Flag("max_robot_messages", _count, "600", "messages a second of one robot; the rest are dropped", "N"),
    _Flag("max_robot_bytes", _bytes, "1000000", "bytes a second of one robot; the rest are dropped", "BYTES"),
    _Flag("model_cache_mb", _count, "256", "memory for robots' models, in MB", "MB"),
    _Flag("past", _past, MEMORY, "keep the past in memory:, a store (file:///…, s3://…) or 0: off", "WHERE"),
    _Flag("past_memory", _memory, "256M", "memory for the past of all robots, at least 16M", "SIZE"),
    _Flag("past_socket", _socket, None, "socket for `past list` and `past delete`", "PATH"),
    _Flag("log_level", _level, "warning", "debug, info, warning or error", "LEVEL"),
)  # fmt: skip


class SettingsParser(CommandParser):
    """A parser whose errors are SettingsErrors."""

    def error(self, message: str) -> NoReturn:
        """Raise SettingsError."""
        raise SettingsError(message)


def make_parser(program: str) -> CommandParser:
    """Make the parser of the program; `robots`, `past` and `convert` have separate ones."""
    parser = SettingsParser(
        prog=program,
        description="Sends the latest state of robots to thousands of viewers. It never commands a robot.",
        allow_abbrev=False,
        version=True,
        statuses=STATUSES,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="run|robots|past|convert")
    commands.add_parser("robots", help="decide who can publish and watch: robots add|set|edit|check|…")
    commands.add_parser("past", help="use the recorded past: past list|export|delete")
    commands.add_parser("convert", help="convert a .posecast file to .mcap or .csv")
    run = commands.add_parser(
        "run", help="run the relay until SIGTERM or Ctrl-C", allow_abbrev=False, statuses=STATUSES
    )
    for flag in FLAGS:
        told = f"{flag.help} [{flag.variable}]" + (f" (default {flag.default})" if flag.default else "")
        if flag.metavar is None:
            run.add_argument(flag.option, action="store_const", const="1", help=told)
        else:
            run.add_argument(flag.option, metavar=flag.metavar, help=told)
    run.add_argument("--workers", help=SUPPRESS)  # removed, see `_refuse_workers`
    return parser


def _refuse_workers(given: str | None, environ: Mapping[str, str]) -> None:
    """Refuse the removed setting `workers`. The value 1 is what a relay does anyway: old scripts and compose
    files set it, and keep working.
    """
    variable = "POSECAST_WORKERS"
    where, text = ("--workers", given) if given is not None else (variable, environ.get(variable) or "1")
    if text != "1":
        raise SettingsError(
            f"{where} {text!r}: removed, leave it out; for more cores or machines, run gateways: "
            "the relay and each gateway with the same --store redis://…, gateways with --role gateway "
            "(docs/how-to/scale/gateways.md)"
        )


def _value(flag: _Flag, given: str | None, environ: Mapping[str, str]) -> object:
    where, text = flag.option, given
    if text is None:
        for variable in (flag.variable, flag.also):
            if variable is not None and environ.get(variable):
                where, text = variable, environ[variable]
                break
    if text is None:
        text = flag.default
    if text is None:
        return None
    try:
        return flag.read(text)
    except ValueError as e:
        raise SettingsError(f"{where} {text!r}: {e}") from None


def _is_loopback(endpoint: str) -> bool:
    host = endpoint.partition("/")[2].rpartition(":")[0].strip("[]")
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def parse(argv: Sequence[str], environ: Mapping[str, str], program: str = "posecast-relay") -> Settings:
    """Read the settings from arguments and environment. Raises SettingsError; SystemExit 0 on --help."""
    asked = vars(make_parser(program).parse_args(argv))
    _refuse_workers(asked["workers"], environ)
    values = {flag.name: _value(flag, asked[flag.name], environ) for flag in FLAGS}
    assert set(values) == {f.name for f in fields(Settings)}
    settings = Settings(**values)  # type: ignore[arg-type]
    if settings.role != "all" and not settings.uses_redis:
        raise SettingsError(f"--role {settings.role}: needs --store redis://…, which connects the roles")
    if not settings.dev and settings.robots is None:
        raise SettingsError(
            "give --robots FILE (who can publish and watch), or --dev to accept any robot on this machine "
            "and show it to everybody"
        )
    emulator = environ.get("FIREBASE_AUTH_EMULATOR_HOST")
    if emulator and not settings.dev:  # the emulator accepts unsigned tokens
        raise SettingsError(
            "FIREBASE_AUTH_EMULATOR_HOST is set: it accepts unsigned tokens, so it needs --dev; else unset it"
        )
    if settings.role == "gateway":  # it talks to viewers and Redis only
        if settings.firebase_database is not None:
            raise SettingsError("--firebase-database: not with --role gateway: give it to the ingest relay")
        return settings
    for endpoint in settings.zenoh_listen:
        _check_endpoint(settings, endpoint)
    return settings


def _check_endpoint(settings: Settings, endpoint: str) -> None:
    encrypted = not endpoint.startswith("tcp/")
    if settings.zenoh_ca is not None and not encrypted:
        raise SettingsError(f"--zenoh-listen {endpoint!r}: --zenoh-ca needs tls/… or quic/…")
    if settings.dev and (encrypted or not _is_loopback(endpoint)):
        raise SettingsError(
            f"--zenoh-listen {endpoint!r}: --dev allows only tcp/… on loopback, because anybody can publish"
        )
    if not encrypted and not _is_loopback(endpoint):
        raise SettingsError(f"--zenoh-listen {endpoint!r}: use tls/… or quic/… for other machines")
    if encrypted and (settings.zenoh_tls_cert is None or settings.zenoh_tls_key is None):
        raise SettingsError(
            f"--zenoh-listen {endpoint!r}: needs a certificate: give --zenoh-tls-cert and --zenoh-tls-key"
        )
