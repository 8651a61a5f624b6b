"""Expands a xacro file in a separate process, which can read only the model's folders."""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from posecast_edge.model.finding import ModelRefused, advise_mesh_tools, make_printable
from posecast_edge.model.urdf.resolver import list_shared_folders, resolve_links

NEEDED = ("xacro", "yaml")
WAIT_S = 60.0
TEXT_MAX = 8 << 20  # bytes, as of a URDF
ANSWER_MAX = 4 * TEXT_MAX  # with JSON's escapes
CHUNK = 1 << 18
# Python's own variables and the home folder, which has user installations; nothing else of the environment
PASSED = [
    "HOME",
    "PATH",
    "PYTHONPATH",
    "PYTHONHOME",
    "PYTHONUSERBASE",
    "PYTHONDONTWRITEBYTECODE",
    "LANG",
    "LC_ALL",
]


@dataclass(frozen=True)
class Expanded:
    """The XML that xacro makes from a file, all files that it read, and notes about them."""

    text: bytes
    inputs: tuple[Path, ...]
    notes: tuple[str, ...]


def expand_xacro(path: Path, packages: Sequence[Path], arguments: Mapping[str, str]) -> Expanded:
    """Expand a xacro file. `arguments`: values for its `<xacro:arg>`.

    Raises ModelRefused, in one line that says what to do, when it can't be expanded within the bounds.
    """
    if any(importlib.util.find_spec(name) is None for name in NEEDED):
        raise ModelRefused(f"this is xacro, which needs the model tools: {advise_mesh_tools()}")
    asked = {
        "path": str(resolve_links(path)),
        "packages": [str(resolve_links(p)) for p in packages],
        "shared": [str(p) for p in list_shared_folders(os.environ)],  # the child has no environment
        "arguments": dict(arguments),
        "wait_s": WAIT_S,
    }
    answer = _ask(json.dumps(asked).encode())
    if "reason" in answer:
        raise ModelRefused(make_printable(str(answer["reason"])), answer.get("line"))
    text = str(answer["text"]).encode()
    if len(text) > TEXT_MAX:
        raise ModelRefused(f"xacro: it expands to more than {TEXT_MAX >> 20} MiB")
    return Expanded(text, tuple(map(Path, answer["inputs"])), tuple(map(str, answer["notes"])))


def _ask(asked: bytes) -> Mapping[str, Any]:
    """The child's answer."""
    process = subprocess.Popen(
        [sys.executable, "-m", "posecast_edge.model.xacro.child"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        cwd="/",  # -m searches it first, and a robot's folder may have a module of a known name
        env={name: os.environ[name] for name in PASSED if name in os.environ},
        start_new_session=True,
    )
    with process:
        if process.stdin is None or process.stdout is None:
            raise ModelRefused("xacro: no process to expand it")
        try:
            process.stdin.write(asked)
            process.stdin.close()
        except BrokenPipeError:
            pass  # its exit status tells why
        output = bytearray()
        while len(output) <= ANSWER_MAX and (chunk := process.stdout.read(CHUNK)):
            output += chunk
        if len(output) > ANSWER_MAX:
            process.kill()
    if len(output) > ANSWER_MAX:
        raise ModelRefused(f"xacro: it expands to more than {TEXT_MAX >> 20} MiB")
    try:
        answer = json.loads(output)
    except ValueError:
        answer = None
    if not isinstance(answer, dict):
        raise ModelRefused(f"xacro: {_name_end(process.returncode)}")
    return answer


def _name_end(status: int) -> str:
    if status in (-signal.SIGXCPU, -signal.SIGKILL):
        return "it takes too long to expand (over 10 s of CPU time); does a macro call itself?"
    if status == -signal.SIGALRM:
        return f"it takes too long to expand (over {WAIT_S:g} s)"
    return f"the process that expands it ended with status {status}"
