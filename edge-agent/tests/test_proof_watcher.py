"""What is new in the file of a credential."""

from __future__ import annotations

import os
from pathlib import Path

from posecast_edge.uplink.credentials import ProofWatcher, read_credential
from posecast_wire import Credential

A, B = ("A" * 43, "B" * 43)


class Watched:
    """A credential's file, and what was warned of."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "credential"
        self._written = 0
        self.write(Credential("hubo", A).line())
        self.warned: list[str] = []
        self.watcher = ProofWatcher(read_credential(str(self.path)), self.warned.append)

    def write(self, text: str, mode: int = 0o600) -> None:
        """A moment later each time, by the file's own clock."""
        self.path.write_text(text)
        self.path.chmod(mode)
        self._written += 1
        os.utime(self.path, ns=(self._written, self._written))

    def look(self, times: int = 3) -> list[str]:
        """The secrets that it gives, looking so often."""
        found = [self.watcher.check() for _ in range(times)]
        return [proof.secret for proof in found if isinstance(proof, Credential)]


def test_another_credential_is_given_once_when_the_file_stands_still(tmp_path: Path) -> None:
    of = Watched(tmp_path)
    assert of.look() == []
    of.write(Credential("hubo", B).line())
    assert of.look(1) == [], "it may not be written whole"
    assert of.look() == [B]
    of.write(Credential("hubo", B).line() + "\n")
    assert of.look() == [], "it is the same"
    of.write(Credential("hubo", A).line())
    assert of.look() == [A]
    assert of.warned == []


def test_what_is_wrong_is_said_once_and_without_the_secret(tmp_path: Path) -> None:
    of = Watched(tmp_path)
    for text, mode, says in (
        (f"posecast1:hubo:{B}x", 0o600, "its secret is cut short or mistyped"),
        (Credential("hubo", B).line(), 0o644, "chmod 600"),
        (Credential("g1", B).line(), 0o600, "is for robot 'g1', not for 'hubo'"),
        ("", 0o600, "invalid credential"),
    ):
        of.write(text, mode)
        assert of.look(5) == []
        (said,) = of.warned
        assert said.startswith(f"{of.path}: ")
        assert says in said
        assert said.endswith("; keeping the previous one")
        assert B not in said
        of.warned.clear()
    of.path.unlink()
    assert of.look(5) == []
    assert len(of.warned) == 1
    of.write(Credential("hubo", B).line())
    assert of.look() == [B]


def test_what_came_from_no_file_is_not_looked_for() -> None:
    for proof in (None, Credential("hubo", A)):
        watcher = ProofWatcher(proof, lambda text: None)
        assert not watcher.has_files
        assert watcher.check() is None
