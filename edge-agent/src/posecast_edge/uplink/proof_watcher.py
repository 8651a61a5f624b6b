"""Notices when the agent's credential or certificate files change."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from posecast_edge.uplink.arguments import read_credential
from posecast_edge.uplink.certificate import Certificate
from posecast_edge.uplink.credential_file import CredentialFile, Proof

FileState = tuple[int, int, int, int]


class ProofWatcher:
    """Watches the files of a credential or certificate. An invalid file has no effect; `warn` is called with
    one line each time it changes."""

    def __init__(self, proof: Proof | None, warn: Callable[[str], None]) -> None:
        self._proof = proof
        self._warn = warn
        self._files: list[Path] = []
        if isinstance(proof, CredentialFile):
            self._files = [proof.path]
        elif isinstance(proof, Certificate):
            self._files = [path for path in (proof.chain, proof.key, proof.ca) if path is not None]
        self._taken = self._seen = self._look()

    @property
    def has_files(self) -> bool:
        """Whether there are files to watch."""
        return bool(self._files)

    def check(self) -> Proof | None:
        """Return the files' content if it is valid and differs from the last call's; otherwise None. Files
        are read only once they are unchanged for two calls, because several are written in turn."""
        before, self._seen = self._seen, self._look()
        if self._seen == self._taken or self._seen != before:
            return None
        self._taken = self._seen
        try:
            return self._read()
        except ValueError as e:
            self._warn(f"{e}; keeping the previous one")
            return None

    def _read(self) -> Proof | None:
        """Raises ValueError, one line without a secret."""
        before = self._proof
        if isinstance(before, Certificate):
            before.check()
            return before  # same paths: Zenoh reads the files itself
        if not isinstance(before, CredentialFile):
            return None
        found = read_credential(str(before.path))
        if found.robot != before.robot:
            raise ValueError(f"{before.path}: it is for robot {found.robot!r}, not for {before.robot!r}")
        if found == before:
            return None
        self._proof = found
        return found

    def _look(self) -> list[FileState | None]:
        return [_find_state(path) for path in self._files]


def _find_state(path: Path) -> FileState | None:
    """Attributes that differ between two versions of a file; None while it is missing."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino, found.st_ctime_ns
