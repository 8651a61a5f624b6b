"""Removes names and texts that no message can carry, and logs them.

A lone half of a surrogate pair is valid in a Python string and in JSON, but cannot be encoded as UTF-8.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from posecast_edge.rate_limited_log import RateLimitedLog
from posecast_edge.sample import Reading, Sample, Values
from posecast_edge.visible import quote


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
        self._bad = RateLimitedLog(say, "invalid names and texts")
        self._good: Mapping[str, str] | None = None  # already checked: most samples repeat the same texts

    def clean(self, sample: Sample, now_s: float) -> Sample:
        """The sample without entries of `info` and `links` that are not valid text."""
        self._bad.tick(now_s)
        info, links = sample.info, sample.links
        if info and info != self._good:
            good = self._texts("info", info, sample, now_s)
            self._good = dict(good)
            if len(good) < len(info):
                sample = sample._replace(info=good)
        if links:
            good = self._texts("the link of", links, sample, now_s)
            if len(good) < len(links):
                sample = sample._replace(links=good)
        return sample

    def clean_names(self, sample: Sample, now_s: float) -> Sample:
        """The sample without fields, channels and bits whose names are not valid text. Needed only for the
        sample that a schema is made from: names that the schema lacks are dropped from later samples
        anyway."""
        values: dict[str, Values] = {}
        for name, of_field in sample.values.items():
            if not is_text(name):
                self._report(f"the field {quote(name)}", sample, now_s)
            elif isinstance(of_field, Mapping):
                values[name] = {
                    label: _bits(reading)
                    for label, reading in of_field.items()
                    if is_text(label) or self._report(f"{quote(name)}.{quote(label)}", sample, now_s)
                }
            else:
                values[name] = [_bits(reading) for reading in of_field]
        return sample._replace(values=values)

    def _texts(self, what: str, given: Mapping[str, str], sample: Sample, now_s: float) -> Mapping[str, str]:
        return {
            name: text
            for name, text in given.items()
            if (is_text(name) and is_text(text)) or self._report(f"{what} {quote(name)}", sample, now_s)
        }

    def _report(self, what: str, sample: Sample, now_s: float) -> bool:
        """Log it. Returns False, so that it can be used in a condition."""
        where = f"{sample.where}: " if sample.where else ""
        self._bad.add(f"{where}{what} is left out: it is not valid Unicode (half of a surrogate pair)", now_s)
        return False


def _bits(reading: Reading) -> Reading:
    return [bit for bit in reading if is_text(bit)] if isinstance(reading, (list, tuple)) else reading
