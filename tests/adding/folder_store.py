"""`--store folder:///PATH`: the newest KEY of each stream, as a file."""

from __future__ import annotations

from pathlib import Path

from posecast_relay.core.hub import Hub
from posecast_relay.core.stream import Stream
from posecast_relay.models.cache import ModelCache
from posecast_relay.runtime.dispatcher import Dispatcher, MemoryStore
from posecast_relay.server.roles import RoleServices
from posecast_relay.zenoh.ingest import ZenohIngest


def connect_folder(url: str, hub: Hub, models: ModelCache, ingest: ZenohIngest) -> RoleServices:
    """Connect the robots that this process hears to the folder."""
    del hub
    folder = Path(url.partition("://")[2])
    folder.mkdir(parents=True, exist_ok=True)

    async def start(dispatcher: Dispatcher) -> None:
        ingest.start(dispatcher)

    async def stop() -> None:
        ingest.stop()

    return RoleServices(models, FolderStore(folder), ingest, start, stop, ingest.admit)


class FolderStore(MemoryStore):
    """Writes at once, which a real one would not."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def keep(self, stream: Stream) -> None:
        """Write the newest state of a stream."""
        if stream.key is not None:
            new = self._folder / "new"
            new.write_bytes(stream.key.payload)
            new.replace(self._folder / f"{stream.robot}.{stream.view}")  # readers see whole files
