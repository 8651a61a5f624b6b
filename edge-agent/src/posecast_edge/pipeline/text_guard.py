"""Removes texts that no message can carry, and logs them.

A lone half of a surrogate pair is valid in a Python string and in JSON, but cannot be encoded as UTF-8.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from posecast_edge.kit import PartLog, quote
from posecast_edge.sample import Sample


def is_text(value: object) -> bool:
    """Whether `value` is a string of Unicode scalar values only (no lone surrogates)."""
    if not isinstance(value, str):
        return False
    if value.isascii():
        return True
    try:
        value.encode()
    except UnicodeEncodeError:
        return False
    return True


class TextGuard:
    """Checks the texts of every sample. Not thread-safe."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._bad = PartLog(say, "invalid names and texts")
        self._good: Mapping[str, str] | None = None  # already checked: most samples repeat the same texts

    def clean(self, sample: Sample) -> Sample:
        """The sample without entries of `info` and `links` that are not valid text."""
        info, links = sample.info, sample.links
        if info and info != self._good:
            good = self._texts("info", info, sample)
            self._good = dict(good)
            if len(good) < len(info):
                sample = sample._replace(info=good)
        if links:
            good = self._texts("the link of", links, sample)
            if len(good) < len(links):
                sample = sample._replace(links=good)
        return sample

    def _texts(self, what: str, given: Mapping[str, str], sample: Sample) -> Mapping[str, str]:
        return {
            name: text
            for name, text in given.items()
            if (is_text(name) and is_text(text)) or self._report(f"{what} {quote(name)}", sample)
        }

    def _report(self, what: str, sample: Sample) -> bool:
        """Log it. Returns False, so that it can be used in a condition."""
        where = f"{sample.where}: " if sample.where else ""
        self._bad.add(what, f"{where}{what} is left out: it is not valid Unicode (half of a surrogate pair)")
        return False
