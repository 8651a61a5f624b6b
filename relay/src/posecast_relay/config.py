"""Settings: flags and POSECAST_* variables, read once into one frozen object. A flag wins over a variable."""

from __future__ import annotations

import argparse
import ipaddress
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import NoReturn, TypeVar

T = TypeVar("T")


class SettingsError(ValueError):
    """A wrong setting: one line that names it."""


@dataclass(frozen=True)
class Settings:
    """What `posecast-relay run` was asked for."""

    dev: bool
    role: str
    host: str
    port: int
    metrics_port: int | None
    store: str
    zenoh_listen: tuple[str, ...]
    static: Path | None
    max_viewers: int
    max_robots: int
    max_connection_age: float | None
    model_cache_mb: int
    log_level: str


def _boolean(text: str) -> bool:
    if text.lower() in ("1", "true", "yes", "on"):
        return True
    if text.lower() in ("", "0", "false", "no", "off"):
        return False
    raise ValueError("use 1 or 0")


def _port(text: str) -> int:
    if not text.isascii() or not text.isdigit() or int(text) > 65535:
        raise ValueError("use a number from 0 to 65535")
    return int(text)


def _count(text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= 1_000_000:
        raise ValueError("use a number from 1 to 1000000")
    return int(text)


def _seconds(text: str) -> float:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= 1_000_000:
        raise ValueError("use a number of seconds from 1 to 1000000")
    return float(text)


def _host(text: str) -> str:
    if not text or any(c.isspace() or c == "/" for c in text):
        raise ValueError("use a host name or address")
    return text


def _store(text: str) -> str:
    if text != "memory://" and not re.match(r"rediss?(\+cluster)?://[^\s]+$", text):
        raise ValueError("use memory://, redis://HOST:PORT, rediss://… (TLS) or redis+cluster://…")
    return text


def _role(text: str) -> str:
    if text not in ("all", "ingest", "gateway"):
        raise ValueError("use all, ingest or gateway")
    return text


def _endpoints(text: str) -> tuple[str, ...]:
    found = tuple(part.strip() for part in text.split(","))
    for part in found:
        if (
            not re.fullmatch(r"tcp/(\[[0-9a-fA-F:]+\]|[^\s:/#?]+):\d{1,5}", part)
            or int(part[-5:].split(":")[-1]) > 65535
        ):
            raise ValueError("use tcp/HOST:PORT, several separated by commas")
    return found


def _directory(text: str) -> Path:
    path = Path(text)
    if not (path / "index.html").is_file():
        raise ValueError("no index.html there")
    return path


def _level(text: str) -> str:
    if text not in ("debug", "info", "warning", "error"):
        raise ValueError("use debug, info, warning or error")
    return text


@dataclass(frozen=True)
class _Flag:
    name: str  # of the field in Settings
    read: Callable[[str], object]
    default: str | None
    help: str
    metavar: str | None = None  # None: a switch
    also: str | None = None  # a further variable, weaker than POSECAST_*

    @property
    def option(self) -> str:
        return "--" + self.name.replace("_", "-")

    @property
    def variable(self) -> str:
        return "POSECAST_" + self.name.upper()


FLAGS = (
    _Flag("dev", _boolean, "", "accept publishers without credentials; Zenoh then listens on loopback only"),
    _Flag("role", _role, "all", "all; ingest: robots to Redis; gateway: Redis to viewers", "ROLE"),
    _Flag("host", _host, "127.0.0.1", "address HTTP listens on", "HOST"),
    _Flag("port", _port, "8080", "port HTTP listens on; 0 = any free one", "PORT", "PORT"),
    _Flag("metrics_port", _port, None, "port for Prometheus, on --host; default: none", "PORT"),
    _Flag("store", _store, "memory://", "memory://, redis://, rediss:// (TLS), redis+cluster://…", "URL"),
    _Flag("zenoh_listen", _endpoints, "tcp/127.0.0.1:7447", "where edges connect; port 0 = any free", "ADDR"),
    _Flag("static", _directory, None, "the built page; default: the one packed in, if any", "DIR"),
    _Flag("max_viewers", _count, "5000", "further ones are told `full`", "N"),
    _Flag("max_connection_age", _seconds, None, "viewers connect anew after this, give or take a tenth", "S"),
    _Flag("max_robots", _count, "1000", "frames of further ones are dropped", "N"),
    _Flag("model_cache_mb", _count, "256", "memory for robots' models", "MB"),
    _Flag("log_level", _level, "warning", "debug, info, warning or error; JSON but on a terminal", "LEVEL"),
)  # fmt: skip


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise SettingsError(message)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="posecast-relay",
        description="Latest state in, thousands of viewers out. It reads robots; it never commands one.",
        allow_abbrev=False,
    )
    run = parser.add_subparsers(dest="command", required=True, metavar="run").add_parser(
        "run", help="serve until SIGTERM or Ctrl-C", allow_abbrev=False
    )
    for flag in FLAGS:
        told = f"{flag.help} [{flag.variable}]" + (f" (default {flag.default})" if flag.default else "")
        if flag.metavar is None:
            run.add_argument(flag.option, action="store_const", const="1", help=told)
        else:
            run.add_argument(flag.option, metavar=flag.metavar, help=told)
    return parser


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


def parse(argv: Sequence[str], environ: Mapping[str, str]) -> Settings:
    """Settings from arguments and environment. SettingsError names what is wrong; SystemExit 0 on --help."""
    asked = vars(_parser().parse_args(argv))
    values = {flag.name: _value(flag, asked[flag.name], environ) for flag in FLAGS}
    assert set(values) == {f.name for f in fields(Settings)}
    settings = Settings(**values)  # type: ignore[arg-type]
    if settings.role != "all" and settings.store == "memory://":
        raise SettingsError(f"--role {settings.role}: needs --store redis://…, where the roles meet")
    if settings.role == "gateway":  # it hears viewers and Redis only
        return settings
    if not settings.dev:
        raise SettingsError(
            "give --dev: this relay knows no credentials yet, so it takes any publisher on loopback"
        )
    for endpoint in settings.zenoh_listen:
        if not _is_loopback(endpoint):
            raise SettingsError(
                f"--zenoh-listen {endpoint!r}: with --dev only loopback, since anybody could publish"
            )
    return settings
