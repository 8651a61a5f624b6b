"""The fixtures of the tests."""

from hypothesis import settings
from posecast_testing import count_examples, share_trust

from .redis_server import redis_server  # noqa: F401
from .s3_server import proxy, s3  # noqa: F401
from .stage import _shared_relays, edges, relay, relays  # noqa: F401

share_trust()
settings.register_profile("posecast", max_examples=count_examples(100), deadline=None)
settings.load_profile("posecast")
