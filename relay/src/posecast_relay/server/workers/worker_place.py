"""Where a further worker finds the first one, and what it is told when it is started."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path


@dataclass(frozen=True)
class WorkerPlace:
    """A further worker's place. `counts`, `control`: descriptors that it inherits."""

    number: int
    workers: int
    port: int
    folder: str
    counts: int
    control: int

    @property
    def feed(self) -> Path:
        """The socket of the feed."""
        return Path(self.folder) / "feed"

    @property
    def door(self) -> Path:
        """The socket of the first worker's private door."""
        return Path(self.folder) / "http"

    @property
    def metrics(self) -> Path:
        """The socket on which this worker tells its metrics."""
        return find_metrics_path(Path(self.folder), self.number)

    def pack(self) -> str:
        """Return it as one word of a command line."""
        return json.dumps(asdict(self), separators=(",", ":"))

    @classmethod
    def unpack(cls, text: str) -> WorkerPlace:
        """Read what `pack` has made."""
        return cls(**json.loads(text))


def find_metrics_path(folder: Path, number: int) -> Path:
    """Return the socket on which worker `number` tells its metrics."""
    return folder / f"metrics-{number}"
