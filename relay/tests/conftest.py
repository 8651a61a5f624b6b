"""The fixtures of the tests."""

from .redis_server import redis_server  # noqa: F401
from .s3_server import proxy, s3  # noqa: F401
from .stage import edges, relays  # noqa: F401
