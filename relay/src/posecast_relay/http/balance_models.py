"""Reads from models what balance needs: once per model, off the event loop, cached with the model."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import NamedTuple, cast

from posecast_relay.balance.model import BalanceModel, read_balance_model
from posecast_relay.kinematics.manifest_values import ModelTreeError
from posecast_relay.models.cache import READ_TIMES, Absent, ModelCache, Unavailable
from posecast_relay.models.refusal_memory import RefusalMemory

LOADING_MAX = 64  # models loaded for balance at once; further robots have no balance until a place is free
WAIT_S = 1.0  # how long the first request waits for the model; loading continues for later requests
LINK_BYTES = 3000  # memory for one link, with its joint, box and mass
SOLE_BYTES = 3000


class NoBalance(NamedTuple):
    """Why a robot has no balance: a code (docs/reference/protocol.md), and the reason in one line."""

    code: str
    detail: str | None = None


AWAY = NoBalance("model-away")


class BalanceModels:
    """Finds the balance data in robots' models. `now` is a clock in seconds."""

    def __init__(self, models: ModelCache, now: Callable[[], float] = time.monotonic) -> None:
        self._models = models
        self._now = now
        self._loading: dict[tuple[str, str], tuple[asyncio.Task[BalanceModel | NoBalance], float]] = {}
        self._away = RefusalMemory(now)  # models that failed to load lately, so that nobody waits for them

    async def find_model(self, robot: str, digest: str, wait_s: float = WAIT_S) -> BalanceModel | NoBalance:
        """Return a robot's model, or why it gives no balance now.

        If the model has to be fetched, wait for it until `wait_s` seconds after the first request for it.
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
        # even with no time to wait, the task gets one turn: enough if the model is cached
        await asyncio.wait({task}, timeout=max(0.0, begun_s + wait_s - self._now()))
        return task.result() if task.done() and not task.cancelled() and task.exception() is None else AWAY

    def _loaded(self, name: tuple[str, str], task: asyncio.Task[BalanceModel | NoBalance]) -> None:
        del self._loading[name]
        error = None if task.cancelled() else task.exception()
        if error is not None:
            self._away.keep(name, str(error))

    async def _load(self, robot: str, digest: str) -> BalanceModel | NoBalance:
        """Raises Absent or Unavailable."""
        await self._models.load_entries(robot, digest)  # fails unless this robot has the model
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
            raise Unavailable("no memory for this model now: try again later")
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
