"""For all tests: what was collected, half a million objects, is not looked through for garbage."""

import gc


def pytest_configure() -> None:
    """Collecting makes no garbage to speak of."""
    gc.disable()


def pytest_collection_finish() -> None:
    """What is here now stays to the end; each `gc.collect()` in a test would take a quarter of a second."""
    gc.freeze()
    gc.enable()
