"""The credential that proves the robot's identity to the relay, and the file that holds it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from posecast_wire.credential import Credential

from posecast_edge.uplink.certificate import Certificate


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
