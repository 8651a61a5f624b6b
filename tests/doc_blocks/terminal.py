"""A reader's terminal: the blocks of a page, typed in a folder that has the files which the page names."""

from __future__ import annotations

import json
import os
import re
import subprocess
import urllib.request
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from posecast_testing import Process, until

from tests.conftest import BIN, Stack
from tests.doc_blocks.block import read_pages

START_S = 90.0


def read_scripts(page: str, words: str = "") -> list[str]:
    """The shell blocks of a page that have these words, in order."""
    return [block.text for block in read_pages()[page] if block.language == "sh" and words in block.text]


def read_script(page: str, words: str) -> str:
    """The one shell block of a page with these words."""
    (script,) = read_scripts(page, words)
    return script


@dataclass
class Terminal:
    """Types into bash. `instead`: what stands on the pages → what the test has in its place."""

    stack: Stack
    folder: Path
    instead: Mapping[str, str] = field(default_factory=dict)
    variables: Mapping[str, str] = field(default_factory=dict)

    def adapt(self, script: str) -> str:
        """The script with the test's own names."""
        for shown, mine in self.instead.items():
            script = script.replace(shown, mine)
        return script

    def _read_environment(self) -> dict[str, str]:
        own = {"PATH": f"{BIN}:{os.environ['PATH']}", "HOME": str(self.folder)}
        return {**os.environ, **own, **self.variables}

    def run(self, script: str, *statuses: int) -> str:
        """To its end with status 0, or another one that is allowed; what it printed on stdout."""
        done = subprocess.run(
            ["bash", "-euc", f"shopt -s expand_aliases\n{self.adapt(script)}"],
            cwd=self.folder,
            env=self._read_environment(),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert done.returncode in (0, *statuses), f"{self.adapt(script)}\n{done.stdout}{done.stderr}"
        return done.stdout

    def start(self, script: str, *more: str) -> Process:
        """A command that goes on, with further arguments at its end."""
        line = " ".join([self.adapt(script).strip(), *more])
        variables = [f"{name}={value}" for name, value in self._read_environment().items()]
        # a pipeline ends as a whole
        script = f"cd '{self.folder}'\ntrap 'trap - TERM; kill 0' TERM\n{{ {line}\n}} & wait $!"
        words = ("env", *variables, "setsid", "bash", "-uc", script)
        return self.stack.start("typed", *words)


def find_line(part: Process, pattern: str) -> re.Match[str]:
    """The first match in what it prints, also on a machine that is busy with other tests."""

    def look() -> re.Match[str] | None:
        assert part.process.poll() is None, part.log
        return re.search(pattern, part.out)

    return until(f"{part.name} prints {pattern}", look, START_S)


def fetch(url: str) -> Any:
    """What a route answers; None while it refuses, or nobody listens."""
    try:
        with urllib.request.urlopen(url, timeout=5) as answer:
            return json.load(answer)
    except OSError:
        return None
