"""Finds channels by their names, however many are looked for, in time proportional to the schema."""

from __future__ import annotations

from collections.abc import Mapping

from posecast_wire import Schema


class ChannelPlaces:
    """Where the channels of a schema's fields stand in the code vector."""

    def __init__(self, schema: Schema) -> None:
        self._schema = schema
        self._fields: dict[str, Mapping[str, int]] = {}

    def find(self, name: str, label: str) -> int | None:
        """The place of a field's channel; None when the frames have none of this name."""
        if name not in self._fields:
            field = self._schema.find_field(name)
            labels = () if field is None else field.labels
            start = 0 if field is None else field.start
            self._fields[name] = {each: start + i for i, each in enumerate(labels)}
        return self._fields[name].get(label)
