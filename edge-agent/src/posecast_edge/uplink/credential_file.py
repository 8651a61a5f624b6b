"""What proves to the relay that this is the robot, and the file where that stands."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from posecast_wire.credential import Credential

from posecast_edge.uplink.certificate import Certificate


@dataclass(frozen=True, eq=False)
class CredentialFile(Credential):
    """A credential that was read from the file `path`, where a new one may stand later. Equal to another one
    that holds the same, wherever it was read."""

    path: Path = Path()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Credential) and _list_content(self) == _list_content(other)

    def __hash__(self) -> int:
        return hash(_list_content(self))


def _list_content(of: Credential) -> tuple[str, str, str | None]:
    return of.robot, of.secret, of.ca


Proof = Credential | Certificate
