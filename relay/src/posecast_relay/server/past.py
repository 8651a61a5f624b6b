"""The past of a process that hears robots: who records it, where it is kept, and for how long."""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass

from posecast_relay.config.settings import Settings
from posecast_relay.core.past.memory_store import MemoryPast
from posecast_relay.core.past.recorder import Recorder
from posecast_relay.core.past.stream_recording import RecordingPorts
from posecast_relay.core.policy.past import compute_kept_longest_s, list_lookers
from posecast_relay.core.policy.policy import Policy

FORGET_EVERY_S = 5.0


@dataclass(frozen=True)
class PastServices:
    """What is recorded, and what is kept of it."""

    kept: MemoryPast
    recorder: Recorder

    async def forget(self, get_policy: Callable[[], Policy], now: Callable[[], float]) -> None:
        """Drop what nobody may ask for any more, every few seconds, until cancelled."""
        while True:
            await asyncio.sleep(FORGET_EVERY_S)
            self.kept.forget_older(now() - compute_kept_longest_s(get_policy()))


def make_past_services(settings: Settings) -> PastServices | None:
    """Make what records the robots that this process hears; None for a gateway, and with `--past 0`."""
    if settings.past is None or settings.role == "gateway":
        return None
    kept = MemoryPast(settings.past_memory)
    ports = RecordingPorts(kept.add, lambda: secrets.randbits(64), time.time)
    return PastServices(kept, Recorder(ports, list_lookers))
