"""Reads a new text of the robots file from an editor or from stdin."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from posecast_relay.config.robots_file import BYTES_MAX
from posecast_relay.config.robots_reader import RobotsError
from posecast_relay.config.settings import SettingsError

EDITORS = ("sensible-editor", "nano", "vim", "vi")  # if neither $VISUAL nor $EDITOR is set
ASK = "Enter: edit again. q: leave the file as it is. "


def read_stdin() -> str:
    """Return the text from stdin. Raises SettingsError if it is not UTF-8 or too long."""
    raw = sys.stdin.buffer.read(BYTES_MAX + 1)
    if len(raw) > BYTES_MAX:
        raise SettingsError(f"stdin: over {BYTES_MAX} bytes")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise SettingsError("stdin: not UTF-8") from None


def edit_text(
    path: Path, before: str, environ: Mapping[str, str], check: Callable[[str], object]
) -> str | None:
    """Let the user edit a text until `check` accepts it. Return the new text; None if it is unchanged.

    `check` raises RobotsError. Raises SettingsError if there is no editor, it fails, or the user gives up.
    """
    editor = _find_editor(environ)
    with tempfile.TemporaryDirectory(prefix="posecast-") as folder:  # private: it has secrets
        copy = Path(folder) / path.name
        copy.touch(0o600)
        copy.write_text(before, "utf-8")
        while True:
            _run(editor, copy)
            try:
                raw = copy.read_bytes()
                text = raw.decode("utf-8-sig")
                if text == before:
                    return None
                if len(raw) > BYTES_MAX:
                    raise RobotsError(f"over {BYTES_MAX} bytes")
                check(text)
                return text
            except UnicodeDecodeError:
                mistakes: tuple[str, ...] = ("not UTF-8",)
            except OSError as e:  # the editor left no file, or a folder
                mistakes = ((e.strerror or str(e)).lower(),)
            except RobotsError as e:
                mistakes = e.mistakes
            for mistake in mistakes:
                sys.stderr.write(f"{path.name}: {mistake}\n")
            sys.stderr.write(ASK)
            sys.stderr.flush()
            answer = sys.stdin.readline()
            if not answer or answer.strip().lower() == "q":
                raise SettingsError(f"{path}: nothing was changed")


def _find_editor(environ: Mapping[str, str]) -> list[str]:
    for variable in ("VISUAL", "EDITOR"):
        if environ.get(variable):
            try:
                return shlex.split(environ[variable])
            except ValueError:
                raise SettingsError(f"{variable} {environ[variable]!r}: a quote is not closed") from None
    for name in EDITORS:
        found = shutil.which(name)
        if found:
            return [found]
    raise SettingsError("no editor found: set $EDITOR, or use `robots set`, or `robots edit < FILE`")


def _run(editor: list[str], copy: Path) -> None:
    try:
        status = subprocess.run([*editor, os.fspath(copy)], check=False).returncode
    except OSError as e:
        raise SettingsError(f"{editor[0]}: {(e.strerror or str(e)).lower()}") from None
    if status != 0:
        raise SettingsError(f"{editor[0]} exited with status {status}: nothing was changed")
