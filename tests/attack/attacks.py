"""All attacks, by name, in the order of the table."""

from tests.attack import by_frames, by_redis, by_requests, by_viewers, by_words, by_zenoh, target

__all__ = ["ATTACKS"]

_ORDER = [by_frames, by_words, by_zenoh, by_viewers, by_requests, by_redis]
ATTACKS = {
    name: attack
    for module in _ORDER
    for name, attack in target.ATTACKS.items()
    if attack.steps.__module__ == module.__name__
}
