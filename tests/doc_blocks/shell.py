"""What the shell blocks of a page call, as bash itself expands it; no program is run."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.doc_blocks.block import Block

# Bash asks this function for every program, because there is none on PATH. A program prints "1", which is
# a word, a number, or a command that this file leaves out. A note is written at once, because both sides of a
# pipe write notes at the same time.
NOTE = r"""
shopt -s expand_aliases
command_not_found_handle() {
  printf '%s\0' "$BLOCK" "$@" $'\1' >> "$NOTES"
  [ "$1" = ls ] && echo "$2" || echo 1
}
cd() { command_not_found_handle cd "$@" > /dev/null; }
"""
FOLDER_OF_PROGRAM = re.compile(r"(?<![\w.\"'=-])(?:[\w.~-]*/)+bin/(?=[\w-])")
READ_FROM = re.compile(r"< +([\w./-]+)")


@dataclass(frozen=True)
class Call:
    """A program with its arguments, and the block that calls it."""

    block: Block
    words: tuple[str, ...]


class ShellError(Exception):
    """Bash does not take a page's block; the text names it."""


def list_calls(blocks: Sequence[Block], folder: Path) -> list[Call]:
    """What the shell blocks of one page call, in a shell that goes through all of them.

    `folder`: empty, for the files that they write. ShellError.
    """
    notes = folder / "notes"
    notes.touch()
    (folder / "activate").touch()
    script = [NOTE]
    for number, block in enumerate(blocks):
        text = FOLDER_OF_PROGRAM.sub("", block.text)
        for name in READ_FROM.findall(text):
            (folder / name.lstrip("/")).parent.mkdir(parents=True, exist_ok=True)
            (folder / name.lstrip("/")).touch()
        script += [f"BLOCK={number}", text]
    (folder / "infra").mkdir(exist_ok=True)
    done = subprocess.run(
        ["/bin/bash", "-c", "\n".join(script)],
        cwd=folder,
        env={"PATH": "/nonexistent", "NOTES": str(notes), "PWD": str(folder)},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    if done.stderr:
        raise ShellError(f"{blocks[0].page}: {done.stderr}")
    calls = []
    for line in notes.read_text(encoding="utf-8").split("\0\1\0"):
        of_block, _, rest = line.partition("\0")
        words = tuple(rest.split("\0"))
        if of_block and words != ("1",):
            calls.append(Call(blocks[int(of_block)], words))
    return calls
