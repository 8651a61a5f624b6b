"""Flags and POSECAST_* variables become one frozen value, or one clear line and exit 2."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from posecast_wire.keys import check_name

from posecast_edge.sources import KINDS, SourceError, split_spec

ENDPOINT = re.compile(r"(tcp|tls|quic)/(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+):(\d{1,5})")


class UsageError(Exception):
    """A wrong flag or variable, in one line."""


@dataclass(frozen=True)
class Settings:
    """What `posecast-edge run` was told."""

    robot: str
    source: str
    relay: str
    hz: float
    key_interval_s: float
    profile: Path | None
    urdf: Path | None
    model: Path | None


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UsageError(message)


def _robot(text: str) -> str:
    try:
        return check_name("robot", text)
    except ValueError as e:
        raise argparse.ArgumentTypeError(str(e)) from None


def _source(text: str) -> str:
    try:
        split_spec(text)
    except SourceError as e:
        raise argparse.ArgumentTypeError(str(e)) from None
    return text


def _relay(text: str) -> str:
    match = ENDPOINT.fullmatch(text)
    if not match or not 0 < int(match[3]) < 65536:
        raise argparse.ArgumentTypeError(f"{text!r} is no endpoint like tcp/127.0.0.1:7447")
    return text


def _number(low: float, high: float) -> type:
    """A float type for argparse within [low, high]."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r} is no number from {low:g} to {high:g}")
        return value

    return parse  # type: ignore[return-value]


def parse_settings(argv: Sequence[str], environment: Mapping[str, str]) -> Settings:
    """UsageError with one line when something is wrong; SystemExit(0) after --help."""
    parser = _Parser(prog="posecast-edge", description="Put a robot on a URL: reads it, never commands it.")
    commands = parser.add_subparsers(dest="command", metavar="run|model|doctor")
    commands.add_parser("model", help="model build: a URDF and its meshes, made small for phones")
    commands.add_parser("doctor", help="what is wrong with a URDF, in plain words")
    run = commands.add_parser(
        "run",
        help="read a source and send it to a relay",
        description="Read a source and send it to a relay. Every flag may also stand in the environment.",
    )

    def flag(name: str, parse: object, text: str, default: object = None) -> None:
        variable = "POSECAST_" + name.upper().replace("-", "_")
        given = environment.get(variable)
        run.add_argument(
            f"--{name}",
            type=parse,  # type: ignore[arg-type]
            default=given if given else default,
            required=default is None and not given and name in ("robot", "source", "relay"),
            metavar=name.upper().replace("-", "_"),
            help=f"{text} [{variable}]",
        )

    flag("robot", _robot, "the robot's name in the link: a-z, 0-9 and -")
    flag("source", _source, f"KIND[:ADDRESS]; kinds: {', '.join(KINDS)}")
    flag("relay", _relay, "where the relay listens, tcp/HOST:PORT")
    flag("hz", _number(1, 60), "frames a second, 1 to 60 (30)", 30.0)
    flag("key-interval", _number(0.2, 600), "seconds between frames that stand alone (4)", 4.0)
    flag("profile", Path, "TOML file that says what the channels mean")
    flag("urdf", Path, "the robot's model; its meshes are served with it")
    flag("model", Path, "instead of --urdf: the folder that `model build` made")
    args = parser.parse_args(argv)
    if args.command is None:
        raise UsageError("say `posecast-edge run …`, or --help")
    if args.urdf and args.model:
        raise UsageError("--urdf and --model: give one of the two")
    return Settings(
        args.robot,
        args.source,
        args.relay,
        args.hz,
        args.key_interval,
        args.profile,
        args.urdf,
        args.model,
    )
