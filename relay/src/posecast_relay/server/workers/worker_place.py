"""Describes to a new worker where it finds the first one."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path


@dataclass(frozen=True)
class WorkerPlace:
    """What a further worker needs to know at its start. `counts`, `control`: inherited descriptors."""

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
        """The socket on which this worker serves its metrics."""
        return find_metrics_path(Path(self.folder), self.number)

    def pack(self) -> str:
        """Encode this as one command-line argument."""
        return json.dumps(asdict(self), separators=(",", ":"))

    @classmethod
    def unpack(cls, text: str) -> WorkerPlace:
        """Decode the result of `pack`."""
        return cls(**json.loads(text))


def find_metrics_path(folder: Path, number: int) -> Path:
    """Return the socket on which worker `number` serves its metrics."""
    return folder / f"metrics-{number}"
