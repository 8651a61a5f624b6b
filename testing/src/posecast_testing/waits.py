"""Waiting for what another process or thread does."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def until(what: str, probe: Callable[[], T | None], deadline_s: float = 20.0) -> T:
    """Return the first answer of `probe` that is neither None nor False; fail with `what` after that time."""
    began_s = time.monotonic()
    while True:
        answer = probe()
        if answer is not None and answer is not False:
            return answer
        waited_s = time.monotonic() - began_s
        assert waited_s < deadline_s, f"not within {deadline_s:g} s: {what}"
        time.sleep(min(0.05, 0.01 + waited_s / 20))  # many programs share the machine


async def until_async(what: str, probe: Callable[[], object], deadline_s: float = 20.0) -> None:
    """Let the event loop go on until `probe` holds. Fails with `what` after that time."""
    end_s = time.monotonic() + deadline_s
    while not probe():
        assert time.monotonic() < end_s, f"not within {deadline_s:g} s: {what}"
        await asyncio.sleep(0.01)
