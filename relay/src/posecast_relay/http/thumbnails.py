"""Finds the small picture in a robot's model, which stands in its manifest as `thumbnail`."""

from __future__ import annotations

from posecast_wire.checked import loads

from posecast_relay.models.cache import Absent, ModelCache, ModelFile

PICTURE_BYTES_MAX = 500_000
TYPES = ("image/jpeg", "image/png", "image/webp")
KEPT = 1000  # names of pictures; beyond, all are found anew


class Thumbnails:
    """Finds the pictures of models. A manifest is read once for it, however many ask."""

    def __init__(self, models: ModelCache) -> None:
        self._models = models
        self._paths: dict[str, str] = {}  # by the model's digest

    async def load_picture(self, robot: str, digest: str) -> ModelFile:
        """Fetch the picture of a robot's model, unless it is kept. Raises Absent or Unavailable."""
        entries = await self._models.load_entries(robot, digest)
        entry = entries.get(self._find_path(digest))
        if entry is None or entry.type not in TYPES or entry.size > PICTURE_BYTES_MAX:
            raise Absent("no picture in this model")
        return await self._models.load_file(robot, digest, self._find_path(digest))

    def _find_path(self, digest: str) -> str:
        """Return the picture's path in a model whose manifest is kept; "" without one."""
        path = self._paths.get(digest)
        if path is None:
            manifest = loads(bytes(self._models.find_data(digest) or b"{}").decode())
            named = manifest.get("thumbnail") if isinstance(manifest, dict) else None
            path = named if isinstance(named, str) else ""
            if len(self._paths) >= KEPT:
                self._paths.clear()
            self._paths[digest] = path
        return path
