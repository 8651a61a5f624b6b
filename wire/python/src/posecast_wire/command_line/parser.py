"""argparse, with `--version`, hints for mistyped words, exit statuses in `--help`, and errors of one line."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from itertools import takewhile
from typing import Any, NoReturn, TypeVar

from posecast_wire.command_line.terminal import paint, wants_color

N = TypeVar("N")

WRONG_ARGUMENTS = 2
ALIKE = 0.6  # the similarity of two words; 1: identical
HEADING = re.compile(r"^([a-z][a-z ]*):", re.MULTILINE)


def suggest(word: str, known: Iterable[str]) -> str:
    """Return ` (did you mean X?)`, or "" if no known word is similar to `word`."""
    import difflib  # noqa: PLC0415 - for mistakes only

    found = difflib.get_close_matches(word, [*known], n=1, cutoff=ALIKE)
    return f" (did you mean {found[0]}?)" if found else ""


class CommandParser(argparse.ArgumentParser):
    """A parser whose errors suggest the likely word. Its subcommands use the same class."""

    def __init__(
        self, *args: Any, statuses: Mapping[int, str] | None = None, version: bool = False, **options: Any
    ) -> None:
        """`statuses`: the meaning of each exit status, for `--help`; `version`: whether to add
        `--version`."""
        super().__init__(*args, **options)
        self._statuses = statuses or {}
        if version:
            self.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: N | None = None
    ) -> tuple[N | argparse.Namespace, list[str]]:
        """Like argparse, but reports a mistyped flag before the argument that is missing because of it."""
        given = sys.argv[1:] if args is None else [*args]
        own = given if self._subparsers is None else takewhile(lambda word: word.startswith("-"), given)
        self._check_flags(own)
        return super().parse_known_args(given, namespace)

    def _check_flags(self, given: Iterable[str]) -> None:
        for word in given:
            if word == "--":
                return
            flag = word.partition("=")[0]
            if not flag.startswith("--") or self._is_flag(flag):
                continue
            if hint := suggest(flag, self._option_string_actions):
                self.error(f"unrecognized arguments: {flag}{hint}")

    def _is_flag(self, word: str) -> bool:
        if self.allow_abbrev:
            return any(known.startswith(word) for known in self._option_string_actions)
        return word in self._option_string_actions

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Reject a value that is not one of the choices, with a suggestion."""
        if action.choices is None or value in action.choices:
            return
        known = [str(choice) for choice in action.choices]
        shown = "".join(c if c.isprintable() else "�" for c in str(value)[:80])
        message = f"{shown!r}{suggest(str(value), known)}: one of {', '.join(known)}"
        if isinstance(action, argparse._SubParsersAction):
            raise argparse.ArgumentError(None, f"unknown command {message}")
        raise argparse.ArgumentError(action, f"invalid choice: {message}")

    def error(self, message: str) -> NoReturn:
        """Exit with one line and status 2."""
        program = paint(f"{self.prog}:", "red", sys.stderr)
        self.exit(WRONG_ARGUMENTS, f"{program} {message}\n")

    def format_help(self) -> str:
        """Return the help with the exit statuses at the end, and bold headings if stdout supports them."""
        text = super().format_help()
        if self._statuses:
            lines = "".join(f"  {status:<22}{means}\n" for status, means in self._statuses.items())
            text += f"\nexit status:\n{lines}"
        if not wants_color(sys.stdout):
            return text
        return HEADING.sub(lambda found: paint(found[1], "bold", sys.stdout) + ":", text)


class _Version(argparse.Action):
    """Prints the installed version. Looks it up only on demand, because that is slow."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from posecast_wire.command_line.installation import find_version  # noqa: PLC0415

        print(f"{parser.prog} {find_version(parser.prog.partition(' ')[0])}")
        parser.exit()
