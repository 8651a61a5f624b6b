"""The fixtures of the adapters' tests."""

from .stage import edges, redis_server, relays  # noqa: F401
