"""Finds channels by name, with an index built in time proportional to the schema."""

from __future__ import annotations

from collections.abc import Mapping

from posecast_wire import Schema


class ChannelPlaces:
    """The positions of a schema's channels in the code vector."""

    def __init__(self, schema: Schema) -> None:
        self._schema = schema
        self._fields: dict[str, Mapping[str, int]] = {}

    def find(self, name: str, label: str) -> int | None:
        """Return the position of a field's channel; None if the frames have no channel of this name."""
        if name not in self._fields:
            field = self._schema.find_field(name)
            labels = () if field is None else field.labels
            start = 0 if field is None else field.start
            self._fields[name] = {each: start + i for i, each in enumerate(labels)}
        return self._fields[name].get(label)
