"""For all tests: the collector of garbage does not walk through thousands of collected tests again and again."""

import gc


def pytest_configure() -> None:
    """Collecting makes no garbage to speak of."""
    gc.disable()


def pytest_collection_finish() -> None:
    """What is here now stays to the end; a `gc.collect()` in a test would take a quarter of a second for it."""
    gc.freeze()
    gc.enable()
