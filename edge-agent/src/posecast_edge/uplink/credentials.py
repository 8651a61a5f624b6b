"""What proves the robot's identity to the relay: a credential or a certificate, read from files that may be
replaced while the agent runs. Knows nothing of Zenoh."""

from __future__ import annotations

import os
import stat
from codecs import BOM_UTF8
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from posecast_wire.credential import LINE_MAX, Credential

if TYPE_CHECKING:
    import ssl


@dataclass(frozen=True)
class Certificate:
    """The certificate of a robot, for a relay that requires mutual TLS instead of a password: paths of PEM
    files. Zenoh reads them again for every connection, so they may be renewed in place.

    `chain`: the robot's certificate, followed by the intermediate ones. `ca`: the authority that signed the
    relay's certificate; None for one that browsers trust.
    """

    chain: Path
    key: Path
    ca: Path | None = None

    def check(self) -> None:
        """Raise ValueError with one line when the files can't be used."""
        import ssl  # noqa: PLC0415 - over 1 MB, not needed without a certificate

        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        try:
            context.load_cert_chain(self.chain, self.key, password="")
        except OSError as e:  # SSLError is one
            why = (
                "not a certificate and its key"
                if isinstance(e, ssl.SSLError)
                else (e.strerror or str(e)).lower()
            )
            raise ValueError(f"{self.chain}, {self.key}: {why}") from None
        if self.key.stat().st_mode & 0o007:
            raise ValueError(f"{self.key}: readable by everybody on this machine: chmod 600 it")
        if self.ca is None:
            return
        try:
            context.load_verify_locations(self.ca)
        except OSError as e:
            why = "not a certificate" if isinstance(e, ssl.SSLError) else (e.strerror or str(e)).lower()
            raise ValueError(f"{self.ca}: {why}") from None


@dataclass(frozen=True, eq=False)
class CredentialFile(Credential):
    """A credential read from the file `path`, whose content may be replaced later. Credentials with the same
    content are equal, whatever file they come from."""

    path: Path = Path()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Credential) and _list_content(self) == _list_content(other)

    def __hash__(self) -> int:
        return hash(_list_content(self))


def _list_content(of: Credential) -> tuple[str, str, str | None]:
    return of.robot, of.secret, of.ca


Proof = Credential | Certificate


def make_tls_context(proof: Proof | None) -> ssl.SSLContext:
    """What TLS with the relay needs: whom to trust, and the robot's own certificate if it has one. Raises
    OSError when the authority's file can't be read."""
    import ssl  # noqa: PLC0415 - takes 5 MB, which an agent must not load just because the link is down

    if isinstance(proof, Certificate):
        context = ssl.create_default_context(cafile=proof.ca)
        with suppress(OSError):  # the files were valid when the agent started
            context.load_cert_chain(proof.chain, proof.key, password="")
        return context
    if proof is None or proof.ca is None:
        return ssl.create_default_context()
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    with suppress(ssl.SSLError):  # then nothing is trusted, which the handshake reports
        context.load_verify_locations(cadata=proof.ca)
    return context


def read_credential(path: str) -> CredentialFile:
    """Read a file with the line that `posecast-relay robots add` printed. Raises ValueError when the file
    can't be read, is readable by everybody or holds no credential; its one line never holds the secret."""
    try:
        with Path(path).open("rb") as file:
            if stat.S_IMODE(Path(path).stat().st_mode) & 0o007:
                raise ValueError("readable by everybody on this machine: chmod 600 it")
            content = file.read(LINE_MAX + len(BOM_UTF8) + 1).removeprefix(BOM_UTF8)
            found = Credential.parse(content.decode("ascii", "replace"))
            return CredentialFile(found.robot, found.secret, found.ca, Path(path))
    except OSError as e:
        raise ValueError(f"{path}: {(e.strerror or str(e)).lower()}") from None
    except ValueError as e:
        raise ValueError(f"{path}: {e}") from None


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
