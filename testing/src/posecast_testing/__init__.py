"""What tests, benchmarks and load, attack and fault tests share: ports, waiting, and the programs started."""

import os

from .ports import free_port, is_listened_on
from .process import Process
from .trust import share_trust
from .waits import until, until_async

__all__ = ("Process", "count_examples", "free_port", "is_listened_on", "share_trust", "until", "until_async")


def count_examples(full: int, few: int = 25) -> int:
    """How many examples Hypothesis tries of a property: `full` in `make test-full`, `few` in `make test`."""
    return full if os.environ.get("POSECAST_FULL") == "1" else min(full, few)
