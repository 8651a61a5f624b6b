"""Writes JSON that every parser accepts: only finite numbers, and always valid UTF-8."""

from __future__ import annotations

import json
import math


def json_bytes(document: object) -> bytes:
    """Encode compactly. NaN and infinity become null; an unpaired surrogate becomes a question mark."""
    try:
        text = json.dumps(document, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    except ValueError:
        text = json.dumps(_finite(document), separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.encode(errors="replace")


def _finite(value: object) -> object:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {name: _finite(each) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(each) for each in value]
    return value
