"""docs/reference/metrics.md has every series of the relay, and no page for operators names another."""

from __future__ import annotations

import re
from collections import Counter
from types import SimpleNamespace
from typing import Any

from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.http.metrics import ArchiveFigures, RelayCollector
from posecast_relay.kit import Breaker
from posecast_relay.past.memory import MemoryPast
from posecast_relay.past.service import HeldRequests
from posecast_relay.redis.past_writer import RedisPastWriter
from posecast_relay.redis.store import RedisStore
from posecast_relay.runtime.dispatcher import Dispatcher
from posecast_relay.runtime.fan_out import FanOut

from .operator_pages import DOCS, PAGES

PAGE = (DOCS / "reference/metrics.md").read_text()


async def test_every_series_is_explained_and_no_other() -> None:
    hub = Hub(Limits())

    def described(_robot: Any) -> dict[str, Any]:
        return {}

    store = RedisStore("redis://nowhere", hub, Dispatcher.now, described)
    dispatcher = Dispatcher(hub, store, FanOut(None))
    mirror = SimpleNamespace(written=Counter(), breaker=Breaker())
    connection = RedisPastWriter("redis://nowhere", 1 << 20)
    kept, held = MemoryPast(1 << 20), HeldRequests()
    archive = SimpleNamespace(measure=lambda: ArchiveFigures(None, 0, 0, 0, 0, 0, 0, 1, 2))
    figures = RelayCollector(
        [dispatcher], mirror, past=kept, connection=connection, held=held, archive=archive
    )
    there = {family.name + ("_total" if family.type == "counter" else "") for family in figures.collect()}
    rows = re.findall(r"^\| `(posecast_\w+)", PAGE, re.MULTILINE)
    assert sorted(rows) == sorted(there)
    networks = {"posecast_web"}  # of Docker
    for page in PAGES:
        named = re.findall(r"\bposecast_[a-z_]+(?![a-z_:])", page.read_text())  # with a colon, it is a volume
        assert {name.removesuffix("_bucket") for name in named} <= there | networks, page
