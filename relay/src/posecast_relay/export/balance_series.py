"""The balance of the past, frame by frame, for writers of files."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from posecast_wire import Schema

from posecast_relay.balance.balance import Balance
from posecast_relay.balance.course import BalanceCourse
from posecast_relay.balance.feet import choose_feet
from posecast_relay.balance.model import BalanceModel, read_balance_model
from posecast_relay.export.table import TableReader, TableRow
from posecast_relay.kinematics.link_poses import FrameReadings, LinkPoses
from posecast_relay.kinematics.manifest_values import ModelTreeError

MODELS_MAX = 8  # that are remembered

FindModel = Callable[[str], bytes | None]


class BalanceSeries:
    """Computes the balance of a table's rows in their order. `find_model`: a manifest by its SHA-256,
    hexadecimal; None where it is not kept. What is wrong with a model's masses and soles, and with feet that
    are left out, is told in the table's losses."""

    def __init__(self, table: TableReader, find_model: FindModel) -> None:
        self._table = table
        self._find_model = find_model
        self._models: dict[str, BalanceModel | None] = {}
        self._body: _Body | None = None

    def has_any(self, models: Iterable[str]) -> bool:
        """Whether any of these models has a balance in frames of any of the table's schemas."""
        return any(
            not BalanceCourse(model, schema).is_empty
            for model in map(self._find, models)
            if model is not None
            for schema in self._table.schemas.values()
        )

    def read(self, row: TableRow) -> Balance | None:
        """The balance of a row; None where its model has no masses and stands on nothing known."""
        model = None if row.model is None else self._find(row.model)
        if row.model is None or model is None:
            self._body = None
            return None
        if self._body is None or not self._body.fits(model, row.schema):
            self._body = _Body(model, row.schema, row.parsed)
            if self._body.why is not None:
                self._table.losses.add_line(f"balance by the model {row.model[:12]}: {self._body.why}")
        return self._body.read(row)

    def _find(self, name: str) -> BalanceModel | None:
        if name not in self._models:
            if len(self._models) >= MODELS_MAX:
                del self._models[next(iter(self._models))]
            self._models[name] = self._load(name)
        return self._models[name]

    def _load(self, name: str) -> BalanceModel | None:
        manifest = self._find_model(name)
        if manifest is None:
            return None
        try:
            model = read_balance_model(manifest)
        except ModelTreeError:  # who writes /tf tells of it
            return None
        if model.why is not None:
            self._table.losses.add_line(f"no balance by the model {name[:12]}: {model.why}")
        return model


class _Body:
    """A model that is posed by frames of one schema."""

    def __init__(self, model: BalanceModel, sha256: str, schema: Schema) -> None:
        """`sha256`: of the schema, which each decoder parses for itself."""
        self._model = model
        self._sha256 = sha256
        self._readings = FrameReadings(schema)
        self._poses = LinkPoses(model.tree)
        choice = choose_feet(model, schema)
        self.why = choice.why  # what is wrong with feet that are left out
        self._course = BalanceCourse(model, schema, choice)

    def fits(self, model: BalanceModel, sha256: str) -> bool:
        """Whether it goes on with these."""
        return model is self._model and sha256 == self._sha256

    def read(self, row: TableRow) -> Balance | None:
        if self._course.is_empty:
            return None
        self._readings.take(row.codes)
        self._poses.update(self._readings)
        world = self._poses.compute_world_poses()
        return self._course.read(row.codes, self._readings, world, row.robot_s)
