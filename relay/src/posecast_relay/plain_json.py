"""JSON as everybody can read it: finite numbers, and UTF-8 whatever the texts hold."""

from __future__ import annotations

import json
import math


def json_bytes(document: object) -> bytes:
    """Compact. What is no finite number becomes null, half of a surrogate pair a question mark."""
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
