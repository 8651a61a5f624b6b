"""Reads of models what balance needs, once however many ask and off the loop, and keeps it with them."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import NamedTuple, cast

from posecast_relay.balance.model import BalanceModel, read_balance_model
from posecast_relay.kinematics.manifest_values import ModelTreeError
from posecast_relay.models.cache import READ_TIMES, Absent, ModelCache, Unavailable
from posecast_relay.models.refusal_memory import RefusalMemory

LOADING_MAX = 64  # models under way for balance; robots beyond have none until there is a place
WAIT_S = 1.0  # who asks for a state first waits so long for the model; it comes for who asks later
LINK_BYTES = 3000  # what a link takes in memory, with its joint, box and mass
SOLE_BYTES = 3000


class NoBalance(NamedTuple):
    """Why there is no balance of a robot: a code (docs/reference/protocol.md), and what is wrong in one
    line."""

    code: str
    detail: str | None = None


AWAY = NoBalance("model-away")


class BalanceModels:
    """Finds what the models of robots say of balance. `now` is a clock in seconds."""

    def __init__(self, models: ModelCache, now: Callable[[], float] = time.monotonic) -> None:
        self._models = models
        self._now = now
        self._loading: dict[tuple[str, str], tuple[asyncio.Task[BalanceModel | NoBalance], float]] = {}
        self._away = RefusalMemory(now)  # models that could not be had lately, so that nobody waits for them

    async def find_model(self, robot: str, digest: str, wait_s: float = WAIT_S) -> BalanceModel | NoBalance:
        """Return a robot's model, or why there is no balance by it now.

        One that has to be fetched is waited for, `wait_s` seconds from when it was asked for first.
        """
        name = robot, digest
        if self._away.find(name) is not None:
            return AWAY
        if name not in self._loading:
            if len(self._loading) >= LOADING_MAX:
                return AWAY
            self._loading[name] = asyncio.create_task(self._load(*name), name="balance"), self._now()
            self._loading[name][0].add_done_callback(lambda done: self._loaded(name, done))
        task, begun_s = self._loading[name]
        # also without waiting the task has one turn, which is enough for what is kept
        await asyncio.wait({task}, timeout=max(0.0, begun_s + wait_s - self._now()))
        return task.result() if task.done() and not task.cancelled() and task.exception() is None else AWAY

    def _loaded(self, name: tuple[str, str], task: asyncio.Task[BalanceModel | NoBalance]) -> None:
        del self._loading[name]
        error = None if task.cancelled() else task.exception()
        if error is not None:
            self._away.keep(name, str(error))

    async def _load(self, robot: str, digest: str) -> BalanceModel | NoBalance:
        """Raises Absent or Unavailable."""
        await self._models.load_entries(robot, digest)  # this robot has it
        kept_as = f"{digest}.balance"
        known = cast("BalanceModel | NoBalance | None", self._models.room.get(kept_as))
        data = self._models.find_data(digest)
        if known is not None:
            return known
        if data is None:
            raise Absent("no such model")
        room = self._models.room
        claim = room.claim(robot, READ_TIMES * len(data) + LINK_BYTES, lambda: None)
        if claim is None:
            raise Unavailable("no room for this model just now")
        try:
            found: BalanceModel | NoBalance
            try:
                found = await asyncio.to_thread(read_balance_model, data)
                size = LINK_BYTES * len(found.tree.links) + SOLE_BYTES * len(found.soles or ())
            except ModelTreeError as e:
                found, size = NoBalance("bad-model", str(e)), len(str(e))
            room.release(claim)
            claim = room.claim(robot, size, lambda: None)
            if claim is not None:
                room.keep(claim, kept_as, found, size)
            return found
        finally:
            if claim is not None:
                room.release(claim)
