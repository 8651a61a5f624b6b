"""Scripts that make shells complete commands, flags and files."""

from __future__ import annotations

import argparse
from pathlib import Path

import shtab
from posecast_edge.cli import model_command, probe, profile_new
from posecast_edge.cli import settings as edge
from posecast_relay.config import robots_command
from posecast_relay.config import settings as relay
from posecast_relay.past_command import convert
from posecast_relay.past_command import main as past

from posecast_command.programs import make_parser
from posecast_command.run import make_demo_parser, make_run_parser

FOLDERS = ("DIR",)  # metavars of flags that take a folder; FILES: of flags that take a file
FILES = ("FILE", "URDF", "PROFILE", "CREDENTIAL", "TLS_CERT", "TLS_KEY", "TLS_CA")


def make_whole_parser() -> argparse.ArgumentParser:
    """The parser of `posecast` with the parsers of all its commands. Used for completion only: each program
    parses with its own parser."""
    models = _commands(model_command.make_parser())
    profile, probing = profile_new.make_parser(), probe.make_parser()
    agent, serving = edge.make_parser({}), relay.make_parser("posecast relay")
    of_edge = {"model": models["model"], "doctor": models["doctor"], "probe": probing, "profile": profile}
    of_relay = {
        "robots": robots_command.make_robots_parser({}),
        "past": past.make_past_parser({}),
        "convert": convert.make_convert_parser(),
    }
    _commands(agent).update(of_edge)
    _commands(serving).update(of_relay)
    whole = make_parser()
    _commands(whole).update(
        {"demo": make_demo_parser(), "run": make_run_parser({}), "edge": agent, "relay": serving}
    )
    _commands(whole).update(of_edge | of_relay)
    return whole


def make_script(shell: str) -> str:
    """The script for bash, zsh or fish."""
    whole = make_whole_parser()
    _complete_files(whole)
    return str(shtab.complete(whole, shell))


def _commands(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """A parser's subcommands, to be changed in place."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            found: dict[str, argparse.ArgumentParser] = action.choices
            return found
    return {}


def _complete_files(parser: argparse.ArgumentParser) -> None:
    for action in parser._actions:
        if action.metavar in FOLDERS:
            action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
        elif action.metavar in FILES or action.type is Path:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    for command in _commands(parser).values():
        _complete_files(command)
