"""The fixtures of the adapters' tests."""

from .redis_server import redis_server  # noqa: F401
from .stage import edges, relays  # noqa: F401
