"""Chooses how an answer is compressed, by the request's `Accept-Encoding` (RFC 9110, section 12.5.3)."""

from __future__ import annotations

import re
from collections.abc import Sequence

from starlette.datastructures import Headers

IDENTITY = "identity"  # not compressed
WEIGHT = re.compile(r"(?:0(?:\.\d{0,3})?|1(?:\.0{0,3})?)")


def choose_encoding(headers: Headers, offered: Sequence[str]) -> str | None:
    """Return the client's choice of the encodings that the server has; None: send it uncompressed.

    Of encodings that the client likes equally, the first one counts. A client that refuses everything else,
    even what is uncompressed, gets it uncompressed all the same, as the RFC allows.
    """
    weights = _read_weights(", ".join(headers.getlist("accept-encoding")))
    best, best_weight = None, weights.get(IDENTITY, 0.0)
    for encoding in offered:
        weight = weights.get(encoding, weights.get("*", 0.0))
        if weight > best_weight or (weight == best_weight > 0.0 and best is None):
            best, best_weight = encoding, weight
    return best


def _read_weights(header: str) -> dict[str, float]:
    """Return the weight of each encoding in a header, in lower case. A malformed weight is no consent: 0."""
    weights: dict[str, float] = {}
    for part in header.lower().split(","):
        name, *parameters = (text.strip() for text in part.split(";"))
        weight = 1.0
        for parameter in parameters:
            key, _, value = (text.strip() for text in parameter.partition("="))
            if key == "q":
                weight = float(value) if WEIGHT.fullmatch(value) else 0.0
        if name:
            weights[name] = weight
    return weights
