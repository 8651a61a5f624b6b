"""What tests, benchmarks and load, attack and fault tests share: ports, waiting, and the programs started."""

import os
from functools import cache

import httpx
from httpx._transports import default

from .ports import free_port, is_listened_on
from .process import Process
from .waits import until, until_async

__all__ = ("Process", "count_examples", "free_port", "is_listened_on", "share_trust", "until", "until_async")


def count_examples(full: int, few: int = 15) -> int:
    """How many examples Hypothesis tries of a property: `full` in `make test-full`, `few` in `make test`."""
    return full if os.environ.get("POSECAST_FULL") == "1" else min(full, few)


def share_trust() -> None:
    """Let all clients of httpx share what they trust: reading 140 authorities takes ten times a request."""
    default.create_ssl_context = cache(httpx.create_ssl_context)  # type: ignore[attr-defined]
