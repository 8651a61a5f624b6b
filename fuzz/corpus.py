"""Cases in files: the seeds and what once failed (`corpus/TARGET/NAME`), and what fails now (`findings/`).

A file `NAME.hex` holds bytes line by line: hexadecimal digits, or after `|` a text, whose line end counts.
Behind `#` stands a remark.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from fuzz.target import Finding

CORPUS = Path(__file__).parent / "corpus"
FINDINGS = Path(__file__).parent / "findings"


def read_case(file: Path) -> bytes:
    """The bytes that a file stands for."""
    if file.suffix != ".hex":
        return file.read_bytes()
    return b"".join(_bytes(line) for line in file.read_text().split("\n"))


def _bytes(line: str) -> bytes:
    if line[:1] == "|":
        return f"{line[1:]}\n".encode()
    return bytes.fromhex(line.partition("#")[0])


def cases(folder: str) -> list[Path]:
    """The files of a folder, shortest first."""
    found = [file for file in (CORPUS / folder).glob("*") if file.is_file()]
    return sorted(found, key=lambda file: (file.stat().st_size, file.name))


def keep(target: str, data: bytes, finding: Finding, folder: Path) -> Path:
    """Write down a case that fails, and beside it (`.txt`) why. Returns the case's file."""
    (folder / target).mkdir(parents=True, exist_ok=True)
    kind = re.sub(r"[^a-z0-9]+", "-", finding.kind.lower())[:60].strip("-")
    file = folder / target / f"{kind}-{hashlib.sha256(data).hexdigest()[:8]}"
    file.write_bytes(data)
    file.with_name(f"{file.name}.txt").write_text(f"{finding.what}\n\n{finding.detail}")
    return file
